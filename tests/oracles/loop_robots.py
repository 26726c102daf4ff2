"""Robots with general loops that several tests use: a four-bar on a turret, two jacks, a spatial
four-bar.
"""

LIFT = """
symgen: 1
name: lift
gravity: [0, 0, -g]
constants: {L0: 0.45, L1: 0.2, L2: 0.5, L3: 0.4, g: 9.81, D7: 0.3}
frames:   # a four-bar on a turret, a wrist on its coupler
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, alpha: pi/2, d: 0,  theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: 0, d: L1, theta: q3, r: 0}
  4: {ant: 1, sigma: 0, mu: 0, alpha: pi/2, d: L0, theta: q4, r: 0}
  5: {ant: 3, sigma: 0, mu: 0, alpha: 0, d: L2, theta: q5, r: 0}
  6: {ant: 4, sigma: 2, alpha: 0, d: L3, theta: 0,  r: 0}
  7: {ant: 3, sigma: 0, alpha: 0, d: D7, theta: q7, r: 0}
loops: [{cut: 5, twin: 6, start: {q2: 1, q3: -0.5518, q4: 1.2956, q5: 0.8475}}]
"""
JACKS = """
symgen: 1
name: jacks
gravity: [0, -g, 0]
constants: {a: 0.5, a2: 0.45, d1: 0.35, LB: 1.3, g: 9.81}
frames:   # boom and stick of an excavator
  1: {ant: 0, sigma: 0, mu: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 0, sigma: 0, mu: 0, gamma: -0.5, alpha: 0, d: d1, theta: q2, r: 0}
  3: {ant: 2, sigma: 1, alpha: pi/2, d: 0, theta: 0, r: q3}
  4: {ant: 3, sigma: 0, mu: 0, alpha: -pi/2, d: 0, theta: q4, r: 0}
  5: {ant: 1, sigma: 2, alpha: 0, d: a, theta: 0, r: 0}
  6: {ant: 1, sigma: 0, mu: 0, alpha: 0, d: LB, theta: q6, r: 0}
  7: {ant: 1, sigma: 0, mu: 0, gamma: 0.4, alpha: 0, d: a2, theta: q7, r: 0}
  8: {ant: 7, sigma: 1, alpha: pi/2, d: 0, theta: 0, r: q8}
  9: {ant: 8, sigma: 0, mu: 0, alpha: -pi/2, d: 0, theta: q9, r: 0}
  10: {ant: 6, sigma: 2, alpha: 0, d: 0.25, theta: 0, r: 0}
loops:
  - {cut: 4, twin: 5, start: {q1: 0.6, q3: 0.5}}
  - {cut: 9, twin: 10, start: {q6: 1.6, q8: 0.9}}
"""
BENNETT = """
symgen: 1
name: bennett
gravity: [0, -9.81, 0]
constants: {a: 0.3, AA: 0.6, BB: 1.1}
frames:   # spatial 4R, a/sin(A) = b/sin(B)
  1: {ant: 0, sigma: 0, alpha: 0, d: 0, theta: q1, r: 0}
  2: {ant: 1, sigma: 0, mu: 0, alpha: AA, d: a, theta: q2, r: 0}
  3: {ant: 2, sigma: 0, mu: 0, alpha: BB, d: a*sin(BB)/sin(AA), theta: q3, r: 0}
  4: {ant: 0, sigma: 0, mu: 0, alpha: -BB, d: -a*sin(BB)/sin(AA), theta: q4, r: 0}
  5: {ant: 4, sigma: 2, alpha: -AA, d: -a, theta: 0, r: 0}
loops: [{cut: 3, twin: 5, start: {q1: 1.0}}]
"""
