"""Small files that ask for much: of strangers, and logs of strangers."""
