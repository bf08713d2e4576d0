"""The products of two states in a block of the equation, as sums that C computes in loops (series.c).

A Taylor coefficient of a product is a Cauchy sum, and most of a step is spent on these. Each loop computes several of
them, because a loop of one sum waits for each addition; and two whose factors are equal or neighbours are one vector of
two numbers. The order of the additions in a sum does not depend on its neighbours, so its bits do not either.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from itertools import takewhile

_Product = tuple[str, str]
"""A product of two states. The last terms of its sum are c[0] of the first with c[m] of the second, and the reverse."""
_MOST_SUMS = 9
"""The number of sums for which a loop has registers: SSE2 has 16, and the factors need some."""


class Products:
    """The sums of some products of two states, in the order in which C computes them.

    In C, those in vectors are `two[n][lane]`, and the others are `one[n]`.
    """

    def __init__(self, states: Sequence[str], block_of: Mapping[str, int], factors: Iterable[tuple[str, ...]]) -> None:
        self._states, self._block_of = states, block_of
        self._place = {name: n for n, name in enumerate(states)}
        self.twos = self.ones = 0
        """The numbers of sums of two products, and of one."""
        self.places: dict[tuple[str, ...], str] = {}
        """The C expression of each product, by its factors in both orders."""
        pairs = {*factors}
        squares = self._in_pairs(sorted((a, b) for a, b in pairs if a == b))
        self.squares = [self._sum(group) for group in squares]
        """The sums of squares in C."""
        groups = self._in_pairs(self._ordered({(a, b) for a, b in pairs if a != b}))
        groups.sort(key=lambda group: [self._place[name] for name in reversed(group[0])])  # common factors together
        self.loops: list[tuple[int, list[str]]] = []
        """For each loop, the bits of the blocks of the second factors, and its sums in C."""
        while groups:
            count = -(-len(groups) // -(-len(groups) // _MOST_SUMS))  # about equally many in each loop
            seconds = {1 << block_of[second] for group in groups[:count] for _, second in group}
            self.loops.append((sum(seconds), [self._sum(group) for group in groups[:count]]))
            del groups[:count]

    def _ordered(self, wanted: set[_Product]) -> list[_Product]:
        """Return products with the factor first that has the most neighbours to be multiplied with."""
        products: list[_Product] = []
        while wanted:
            first, seconds = self._longest_run(wanted)
            products += [(first, second) for second in seconds]
            wanted -= {pair for second in seconds for pair in ((first, second), (second, first))}
        return products

    def _longest_run(self, wanted: Collection[_Product]) -> tuple[str, list[str]]:
        """Return a state and neighbours in one block with which it is to be multiplied: as many as possible."""
        candidates = {*wanted, *((b, a) for a, b in wanted)}

        def run(pair: _Product) -> list[str]:
            first, second = pair
            block, neighbours = self._block_of[second], self._states[self._place[second] :]
            return [*takewhile(lambda y: (first, y) in candidates and self._block_of[y] == block, neighbours)]

        first, second = max(
            sorted(candidates, key=lambda pair: (pair[0], self._place[pair[1]])), key=lambda pair: len(run(pair))
        )
        return first, run((first, second))

    def _in_pairs(self, products: Sequence[_Product]) -> list[list[_Product]]:
        """Return as many pairs of products that form a vector as there are, or nearly so, and the others alone."""
        partners = {a: [b for b in products if self._are_neighbours(a, b)] for a in products}
        groups = []
        while partners:  # those with the fewest choices first
            one = min(partners, key=lambda product: len(partners[product]) or len(products))
            other = min(partners[one], key=lambda product: len(partners[product]), default=one)
            groups.append(sorted({one, other}, key=lambda product: [self._place[name] for name in product]))
            partners = {
                a: [b for b in own if b not in (one, other)] for a, own in partners.items() if a not in (one, other)
            }
        return groups

    def _are_neighbours(self, *products: _Product) -> bool:
        """Return True when each factor of one product is that of the other, or follows on it in memory."""
        (a, b), (c, d) = ([self._place[name] for name in product] for product in products)
        return not {(c - a, d - b), (a - c, b - d)}.isdisjoint({(0, 1), (1, 0), (1, 1)})

    def _sum(self, group: Sequence[_Product]) -> str:
        """Write the sum of one product or two for the loops of series.c, and note where it is."""
        kind, n, two = ("TWO", self.twos, True) if len(group) == 2 else ("ONE", self.ones, False)
        for lane, (a, b) in enumerate(group):
            self.places[a, b] = self.places[b, a] = f"two[{n}][{lane}]" if two else f"one[{n}]"
        self.twos += two
        self.ones += not two
        return f"DO##_{kind}(OP, {n}, {', '.join(f'Y_{name}' for product in group for name in product)})"
