"""What a log's events make an estimator believe, and how right that was: what joins the two.

`probabilities` knows evidence and time, and no log; here its estimators are asked about one.
"""
