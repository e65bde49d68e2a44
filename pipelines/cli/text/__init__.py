"""The printed texts of commands, from their documents."""
