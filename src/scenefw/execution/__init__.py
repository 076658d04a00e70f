"""One run from a composed config: parts are built, the task runs, what made the results is kept."""
