"""Features of photographs, the pairs that are worth matching, and the matches of a pair.

Enters: gray photographs. Leaves: SIFT features, pairs of photographs, pairs of features. Begin with
`mutual_matches`.
"""
