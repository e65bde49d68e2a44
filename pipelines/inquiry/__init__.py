"""The inquiry: after an ambiguous diagnosis the station measures what parts the rivals, and all is diagnosed together."""
