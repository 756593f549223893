"""Turn contact databases into surrogates: so far, the scores they are judged by."""
