"""Studies: many runs of one script, through the public interface only."""
