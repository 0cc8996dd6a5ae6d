"""What is wrong with a profile."""


class ProfileError(ValueError):
    """A profile cannot be used.

    The message is the first problem, `file:line: key: what is wrong`, and how many more there are; `problems`
    holds all of them in that form, in the file's order. What concerns no line of the file, such as a file
    that is not there, begins with `file: `.
    """

    def __init__(self, problems: list[str]) -> None:
        more = len(problems) - 1
        also = f" (and {more} more problem{'s' if more > 1 else ''})" if more else ""
        super().__init__(problems[0] + also)
        self.problems = problems
