"""Models as symbols: closed forms factored by parameter, the recursion as a list of equations;
SymPy, LaTeX, MathML, text.

The recursions of `derive` give every model as nodes of one graph, as they do for emitted modules. A
closed form multiplies the graph out
(`polynomial`, `closed`), a listing reads its steps in their order (`listing`). sympy is loaded by
`sympy_objects` alone, when an object is asked for.
"""
