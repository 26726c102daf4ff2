"""Base parameters of a robot: what can be identified, and what each is made of."""

from symgen import certify, load_robot, regroup

regrouping = regroup(load_robot("puma560"))
print(f"{len(regrouping)} of {len(regrouping.robot.parameters)} parameters can be identified; proved: {certify(regrouping).valid}")
for parameter in regrouping.base:
    if parameter.name != parameter.own:  # it absorbs others
        print(f"{parameter.name:6} = {parameter.formula}")
print("no effect:", *regrouping.no_effect)
