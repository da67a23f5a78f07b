"""Small helps that know no door: words, keywords, lazy names."""
