"""The job that removes noise: the nearby mesh of small E."""
