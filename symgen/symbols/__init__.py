"""Models as symbols: closed forms factored by parameter, the recursion as a list of equations.

SymPy, LaTeX, MathML, text.

The recursions of `derive` give every model as nodes of one graph, as they do for emitted modules. A
closed form multiplies the graph out (`expansion`), a listing reads its steps in their order
(`listing`); both are written by SymPy's printers with the letters of the literature (`printers`).
"""
