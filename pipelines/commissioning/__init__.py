"""Pages and documents of bring-ups and of recordings of a station's links."""
