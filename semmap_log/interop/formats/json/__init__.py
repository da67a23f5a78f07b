"""JSON documents and lines, as programs get them."""
