"""Holds USD stages against every validator of usd-core; fails on any finding, error or warning.

usage: python validate-usd.py FILE.usda...       (needs the package usd-core)
"""

import sys

from pxr import Usd, UsdGeom, UsdValidation


def findings(path):
    stage = Usd.Stage.Open(path)
    validators = UsdValidation.ValidationRegistry().GetOrLoadAllValidators()
    found = [f"{e.GetType()} {e.GetName()}: {e.GetMessage()}" for e in UsdValidation.ValidationContext(validators).Validate(stage)]
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/Root/Body"))
    points = mesh.GetPointsAttr()
    sound, reason = UsdGeom.Mesh.ValidateTopology(
        mesh.GetFaceVertexIndicesAttr().Get(), mesh.GetFaceVertexCountsAttr().Get(), len(points.Get(0))
    )
    if not sound:
        found.append(reason)
    frames = points.GetTimeSamples()
    if len(frames) != stage.GetEndTimeCode() - stage.GetStartTimeCode() + 1 or len(frames) < 2:
        found.append(f"{len(frames)} samples of the points")
    if points.Get(frames[0]) == points.Get(frames[-1]):
        found.append("nothing moves")
    print(f"{path}: {len(found)} findings of {len(validators)} validators; {len(frames)} frames of {len(points.Get(0))} vertices")
    return found


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    problems = [f for path in sys.argv[1:] for f in findings(path)]
    for problem in problems:
        print(" ", problem)
    sys.exit(1 if problems else 0)
