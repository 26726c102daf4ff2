"""Base parameters of a robot: what can be identified, and what each is made of."""

import symgen

base = symgen.regrouping(symgen.load_robot("puma560"))
print(
    f"{len(base)} of {len(base.robot.parameters)} parameters can be identified; proved: "
    f"{symgen.certificate(base).valid}"
)
for parameter in base.base:
    if parameter.name != parameter.own:  # it absorbs others
        print(f"{parameter.name:6} = {parameter.formula}")
print("no effect:", *base.no_effect)
