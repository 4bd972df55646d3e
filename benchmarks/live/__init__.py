"""The live view in a browser, measured: the console that runs, the page that shows it, and other ways to show it."""
