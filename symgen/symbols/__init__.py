"""Symbolic models of a robot, as closed forms or as recursions, in SymPy, LaTeX, MathML or text.

The recursions of `derive` give every model as one computation graph, the same graph that emitted
modules are written from. A closed form expands the graph and factors the result by parameter
(`expansion`). A listing gives the recursion as equations, in the order in which they are computed
(`symbolic_model`). Both are written by SymPy's printers with the letters of the literature (`printers`).
"""
