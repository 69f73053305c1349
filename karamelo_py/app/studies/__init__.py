"""Studies: many runs of one script, and what they show together.

They use what every user has: the script, its variables, the command line, log and run.json.
"""
