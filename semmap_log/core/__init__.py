"""What everything is built on: values, events, bytes, files; knows no log."""
