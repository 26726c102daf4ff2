"""The names of one emitted text, and what gives way where two would meet.

Constants, parameters and base parameters are the user's: they keep their names in every text, or
`naming.check_names` refuses them before anything is derived. Steps of the recursion, arrays and
words of a language give way by one rule, an underscore at the end, and the header says so.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable


class Namespace:
    """The names of one text.

    Parameters
    ----------
    names : iterable of str
        Constants, parameters and base parameters of the robot.
    is_word : callable
        Whether the language of the text has a word of its own of that name.
    """

    def __init__(self, names: Iterable[str], is_word: Callable[[str], bool] = lambda name: False):
        self._is_word, self._taken = is_word, {*names}
        self._written = {name: name for name in self._taken}
        self.renamed: dict[str, str] = {}
        for name in sorted(filter(is_word, self._taken)):
            self._written[name] = self.own(name)

    def of_file(self, name: str) -> str:
        """The name of a constant or parameter as this text writes it."""
        return self._written.get(name, name)

    def has(self, name: str) -> bool:
        """Whether something in this text is called so."""
        return name in self._taken or self._is_word(name)

    def own(self, name: str) -> str:
        """A name of ours, which nothing else in this text has."""
        free = f"{name}_" if self._is_word(name) else name
        while free in self._taken:
            free += "_"
        self._taken.add(free)
        if free != name:
            self.renamed[free] = name
        return free

    def inner(self) -> Namespace:
        """The names of one function of the text; what it renames, the text renames."""
        scope = Namespace((), self._is_word)
        scope._taken, scope._written, scope.renamed = {*self._taken}, self._written, self.renamed
        return scope
