"""Tables brought from elsewhere: raw records and dwells in the exchange format."""
