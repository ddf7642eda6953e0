"""Writes reference.txt and reference_frames.txt: rates and frames of the robots beside this file, by Pinocchio.

pip install pin
python codegen/tests/robots/reference.py

A line is a robot, its state by names, and the rates of its velocities. Followers are eliminated by the matrix S of
their rates, `S^T M S a = S^T (f - M S' u - h)` with a constant S; friction is that of the imported model,
`f tanh(q'/0.01)`. Behind a state with the place and attitude of a free body, a line of frames has a link, its pose (place,
rotation by rows), its twist in its own axes (angular velocity first), and the rate of that without accelerations.
"""

import pathlib
import xml.etree.ElementTree as tree

import numpy as np
import pinocchio as pin

here = pathlib.Path(__file__).parent
rng = np.random.default_rng(20)
lines, frames = [], []
LINKS = {"arm": ["bracket", "finger", "thumb"], "flyer": ["rod"], "cart": []}


def dynamics(joint, name):
    element = joint.find("dynamics")
    return 0.0 if element is None else float(element.get(name) or 0)


for robot, is_floating in [("arm", False), ("flyer", True), ("cart", False)]:
    path = str(here / f"{robot}.urdf")
    model = pin.buildModelFromUrdf(path, pin.JointModelFreeFlyer()) if is_floating else pin.buildModelFromUrdf(path)
    data = model.createData()
    joints = {joint.get("name"): joint for joint in tree.parse(path).getroot().findall("joint")}
    for _ in range(4):
        q, v, force = pin.neutral(model), np.zeros(model.nv), np.zeros(model.nv)
        state, columns = {}, {}

        def free(name, place):
            columns[name] = np.zeros(model.nv)
            columns[name][place] = 1

        followers = []
        for k in range(1, model.njoints):
            name, joint = model.names[k], model.joints[k]
            i, j = joint.idx_q, joint.idx_v
            if name == "root_joint":
                quaternion = rng.normal(size=4)
                q[0:3], q[3:7] = rng.uniform(-1, 1, 3), quaternion / np.linalg.norm(quaternion)
                v[0:6] = rng.uniform(-2, 2, 6)
                up = pin.Quaternion(q[3:7]).toRotationMatrix().T @ np.array([0, 0, 1])
                for n in range(3):
                    state[f"V{n + 1}"], state[f"Omega{n + 1}"], state[f"up{n + 1}"] = v[n], v[3 + n], up[n]
                    free(f"V{n + 1}", n)
                    free(f"Omega{n + 1}", 3 + n)
                state["height"] = q[2]
                continue
            if joint.nv == 3:
                x, y, angle = rng.uniform(-1, 1, 3)
                rates = rng.uniform(-2, 2, 3)
                q[i : i + 4] = [x, y, np.cos(angle), np.sin(angle)]
                # Its translation is in the frame of the link.
                turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
                v[j : j + 3] = [*(turn @ rates[:2]), rates[2]]
                state |= dict(zip([f"{name}_x", f"{name}_y", f"{name}_angle"], [x, y, angle]))
                state |= dict(zip([f"{name}_x_dot", f"{name}_y_dot", f"{name}_angle_dot"], rates))
                planar = (name, j, turn, rates)
                for n in range(3):
                    free(f"{name}_{n}", j + n)
                continue
            mimic = joints[name].find("mimic")
            if mimic is not None:
                followers.append((name, i, j, mimic))
                continue
            limit = joints[name].find("limit")
            low, high = (-3, 3) if limit is None else (float(limit.get("lower")), float(limit.get("upper")))
            value, rate = rng.uniform(low, high), rng.uniform(-2, 2)
            q[i : i + joint.nq] = [value] if joint.nq == 1 else [np.cos(value), np.sin(value)]
            v[j] = rate
            state[name], state[f"{name}_dot"] = value, rate
            free(f"{name}_dot", j)
        for name, i, j, mimic in followers:
            leader, factor = mimic.get("joint"), float(mimic.get("multiplier"))
            q[i], v[j] = factor * state[leader] + float(mimic.get("offset")), factor * state[f"{leader}_dot"]
            columns[f"{leader}_dot"][j] = factor
        for k in range(1, model.njoints):
            name, j = model.names[k], model.joints[k].idx_v
            if name in joints:
                force[j] = -dynamics(joints[name], "damping") * v[j]
                force[j] -= dynamics(joints[name], "friction") * np.tanh(v[j] / 0.01)
        mass = pin.crba(model, data, q)
        mass = np.triu(mass) + np.triu(mass, 1).T
        h = pin.nonLinearEffects(model, data, q, v)
        s = np.array(list(columns.values())).T
        a = dict(zip(columns, np.linalg.solve(s.T @ mass @ s, s.T @ (force - h))))
        if robot == "cart":
            name, j, turn, rates = planar
            # d/dt (turn^T v) with turn' = -w J turn.
            body = np.array([a.pop(f"{name}_0"), a.pop(f"{name}_1")])
            bent = rates[2] * np.array([-rates[1], rates[0]])
            a[f"{name}_x_dot"], a[f"{name}_y_dot"] = turn.T @ body + bent
            a[f"{name}_angle_dot"] = a.pop(f"{name}_2")
        told = [" ".join(f"{key}={float(value)!r}" for key, value in values.items()) for values in (state, a)]
        lines.append(f"{robot} | {told[0]} | {told[1]}")
        if is_floating:
            position, (x, y, z, w) = q[0:3], q[3:7]
            state |= {f"position{n + 1}": position[n] for n in range(3)}
            state |= dict(zip([f"attitude{n}" for n in "wxyz"], [w, x, y, z]))
        pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
        pin.updateFramePlacements(model, data)
        for link in LINKS[robot]:
            frame, local = model.getFrameId(link, pin.FrameType.BODY), pin.ReferenceFrame.LOCAL
            at = data.oMf[frame]
            twist = pin.getFrameVelocity(model, data, frame, local)
            drift = pin.getFrameAcceleration(model, data, frame, local)
            numbers = [*at.translation, *at.rotation.flatten()]
            for motion in twist, drift:
                numbers += [*motion.angular, *motion.linear]
            told = " ".join(f"{key}={float(value)!r}" for key, value in state.items())
            frames.append(f"{robot} | {told} | {link} | " + " ".join(repr(float(x)) for x in numbers))
(here / "reference.txt").write_text("\n".join(lines) + "\n")
(here / "reference_frames.txt").write_text("\n".join(frames) + "\n")
