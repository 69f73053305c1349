"""Studies: many runs of one script, and what they show together.

They use the public interface only: script, variables, command line, log and run.json.
"""
