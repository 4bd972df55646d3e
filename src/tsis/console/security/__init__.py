"""Who may talk to the console: a token or a login, known hosts, own pages."""
