"""The daemon among clients that ask anything, in any order."""
