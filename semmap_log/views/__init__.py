"""What people look at: rerun recordings, tables. Each third party lives in its own edge file."""
