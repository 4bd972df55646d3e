"""Methods of matching points beside other programs: trials with known matches, runs, summaries, and their trust."""
