"""A log as one self-contained HTML page, for readers who install nothing.

`content` puts the page together. `page_events` reads the excerpt once; it, `plans` and `content`
turn it into what the page shows, as values that JSON holds. `content` writes them into the files of
the folder `page`, which are plain HTML, CSS and JavaScript.
"""
