"""One run of a composed config: builds parts, runs the task, records how results were made."""
