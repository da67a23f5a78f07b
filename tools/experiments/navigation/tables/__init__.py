"""What the runs come to: tables, histograms, a page and recordings, all made from the logs."""
