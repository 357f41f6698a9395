"""What a browser is shown: the API's documentation and a page for each problem, all from this package."""
