"""What commands print, from their documents."""
