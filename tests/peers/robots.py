"""Compares robots from URDF with Pinocchio at random states, to 1e-12 of the largest entry.

    pip install pin==4.1.0 example-robot-data==6.0.0, and the wheel of pyhamel
    python tests/peers/robots.py [ROBOT ..]

Per robot, at 20 states: rates (aba), inverse dynamics (rnea), mass matrix (crba), forces at zero accelerations (nle)
and at rest (generalized gravity); mass centre with its velocity and Jacobian (centerOfMass, jacobianCenterOfMass),
momentum about it and its matrix (ccrba); and of the frames of up to four last links poses, twists, Jacobians in the
frames' own axes, drifts, and `J M^-1 J^T`. Damping and friction are zero, as Pinocchio's algorithms leave them out. Joints that follow others
are eliminated by the matrix `S` of their rates, `v = S u`, and rates are those of `S^T M S u' = -S^T h` then. A robot is
a path in the folder of the package `example-robot-data`, with `+` for a floating base. Exit status 1 where something
differs.
"""

import pathlib
import sys
import tempfile
import warnings
import xml.etree.ElementTree as tree
from importlib.metadata import files

import numpy as np
import pinocchio as pin
import pyhamel

ROBOTS = {
    "ur5": "ur_description/urdf/ur5_robot.urdf",
    "panda": "panda_description/urdf/panda.urdf",
    "z1": "z1_description/urdf/z1.urdf",
    "solo12": "+solo_description/robots/solo12.urdf",
    "anymal_c": "+anymal_c_simple_description/urdf/anymal.urdf",
    "simple_humanoid": "+simple_humanoid_description/urdf/simple_humanoid.urdf",
}
MORE = (
    "center_of_mass, center_of_mass_jacobian, centroidal_momentum, centroidal_momentum_matrix, operational_space"
)
N_STATES = 20
TOLERANCE = 1e-12


def folder():
    """Where the package keeps its robots."""
    for file in files("example-robot-data"):
        parts = file.parts
        if "robots" in parts:
            path = pathlib.Path(file.locate())
            return next(p for p in path.parents if p.name == "robots")
    sys.exit("the package example-robot-data has no robots")


def leaves(path):
    """Names of the last links, at most four, those behind the most joints first."""
    joints = tree.parse(path).getroot().findall("joint")
    before = {joint.find("child").get("link"): joint for joint in joints}
    parents = {joint.find("parent").get("link") for joint in joints}

    def depth(link):
        joint = before.get(link)
        if joint is None:
            return 0
        return depth(joint.find("parent").get("link")) + (joint.get("type") != "fixed")

    return sorted((link for link in before if link not in parents), key=depth, reverse=True)[:4]


def followers(path):
    """Joints that follow another one, with its name, the factor and the offset."""
    found = {}
    for joint in tree.parse(path).getroot().findall("joint"):
        mimic = joint.find("mimic")
        if mimic is not None:
            numbers = float(mimic.get("multiplier") or 1), float(mimic.get("offset") or 0)
            found[joint.get("name")] = (mimic.get("joint"), *numbers)
    return found


def with_quarter_turns(path, folder):
    """The file with all digits of angles that are rounded quarter turns, which hamel takes as such: for both tools."""
    root = tree.parse(path)
    for origin in root.getroot().iter("origin"):
        angles = [float(x) for x in (origin.get("rpy") or "0 0 0").split()]
        turns = [round(angle / (np.pi / 2)) * np.pi / 2 for angle in angles]
        exact = [turn if abs(angle - turn) < 1e-4 else angle for angle, turn in zip(angles, turns)]
        origin.set("rpy", " ".join(repr(float(x)) for x in exact))
    root.write(folder / path.name)
    return folder / path.name


def plain(name):
    """A name of the file as the model has it."""
    return name.replace("-", "_").replace(" ", "_")


class Robot:
    """A robot in both tools, and how the numbers of one are those of the other."""

    def __init__(self, path, floats, folder, n_frames=4, more="", bodies=False):
        path = with_quarter_turns(path, folder)
        free = [pin.JointModelFreeFlyer()] if floats else []
        self.pin = pin.buildModelFromUrdf(str(path), *free)
        self.data = self.pin.createData()
        self.links = leaves(path)[:n_frames]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", pyhamel.ModelWarning)
            text = pyhamel.import_robot(path, floating=floats, limits="none", frames=self.links, bodies=bodies)
        end = text.rindex("}")
        wants = ["rhs, inverse_dynamics, mass_matrix, bias, gravity, frames", "reconstruction" if floats else "", more]
        wanted = ", ".join(filter(None, wants))
        text = f"{text[:end]}    scene robot {{ want {wanted}; }}\n}}\n"
        model = pyhamel.load(text, scene="robot")
        passive = {name: 0.0 for name in model.params if name.startswith(("damping_", "friction_"))}
        passive.pop("friction_speed", None)
        self.model = model.with_params(**passive)
        # Velocities of Pinocchio by those of hamel.
        self.by_own = np.zeros((self.pin.nv, len(self.model.velocities)))
        self.followers = followers(path)
        for k, name in enumerate(self.model.velocities):
            if floats and name[:-1] in ("Omega", "V"):
                self.by_own[int(name[-1]) - 1 + (3 if name.startswith("Omega") else 0), k] = 1.0
                continue
            joint = next(own for own in self.pin.names if plain(own) == name.removesuffix("_dot"))
            self.by_own[self.pin.joints[self.pin.getJointId(joint)].idx_v, k] = 1.0
            for follower, (leader, factor, _) in self.followers.items():
                if leader == joint:
                    self.by_own[self.pin.joints[self.pin.getJointId(follower)].idx_v, k] = factor

    def random(self, rng):
        """A state of both: `q`, `v`, `y`."""
        q, u = pin.neutral(self.pin), rng.uniform(-2, 2, len(self.model.velocities))
        v = self.by_own @ u
        values, angles = {}, {}
        for k in range(1, self.pin.njoints):
            joint = self.pin.joints[k]
            i = joint.idx_q
            if joint.nv == 6:
                quaternion = rng.normal(size=4)
                quaternion /= np.linalg.norm(quaternion)
                q[i : i + 3], q[i + 3 : i + 7] = rng.uniform(-1, 1, 3), quaternion
                up = pin.Quaternion(q[i + 3 : i + 7]).toRotationMatrix()[2]
                x, y, z, w = quaternion
                values |= dict(zip(["attitudew", "attitudex", "attitudey", "attitudez"], [w, x, y, z]))
                for n in range(3):
                    values |= {f"up{n + 1}": up[n], f"position{n + 1}": q[i + n]}
                values["height"] = q[i + 2]
                continue
            if self.pin.names[k] in self.followers:
                leader, factor, offset = self.followers[self.pin.names[k]]
                angle = factor * angles[leader] + offset
            else:
                angle = angles[self.pin.names[k]] = rng.uniform(-2, 2)
            q[i : i + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
            values[plain(self.pin.names[k])] = angle
        values |= dict(zip(self.model.velocities, u))
        return q, v, np.array([values[name] for name in self.model.state])

    def differences(self, rng):
        """The largest differences by quantity, relative to the largest entry of each."""
        found = {}

        def compare(what, own, other):
            own, other = np.asarray(own), np.asarray(other)
            scale = max(np.abs(other).max(), 1e-300)
            found[what] = max(found.get(what, 0.0), float(np.abs(own - other).max() / scale))

        model, data, s = self.pin, self.data, self.by_own
        rows = [self.model.state.index(name) for name in self.model.velocities]
        twist = [3, 4, 5, 0, 1, 2]
        for _ in range(N_STATES):
            q, v, y = self.random(rng)
            a = rng.uniform(-3, 3, len(self.model.velocities))
            mass = pin.crba(model, data, q)
            mass = s.T @ (np.triu(mass) + np.triu(mass, 1).T) @ s
            bias = s.T @ pin.nonLinearEffects(model, data, q, v)
            if self.followers:
                rates = np.linalg.solve(mass, -bias)
            else:
                rates = s.T @ pin.aba(model, data, q, v, np.zeros(model.nv))
            compare("rates", self.model.rhs(y)[rows], rates)
            compare("inverse_dynamics", self.model.inverse_dynamics(y, a), s.T @ pin.rnea(model, data, q, v, s @ a))
            compare("bias", self.model.bias(y), bias)
            compare("gravity", self.model.gravity(y), s.T @ pin.computeGeneralizedGravity(model, data, q))
            compare("mass_matrix", self.model.mass_matrix(y), mass)
            pin.ccrba(model, data, q, v)
            momentum, matrix = data.hg.vector[twist], data.Ag[twist] @ s
            compare("centroidal_momentum", self.model.centroidal_momentum(y), momentum)
            compare("centroidal_momentum_matrix", self.model.centroidal_momentum_matrix(y), matrix)
            pin.centerOfMass(model, data, q, v)
            compare("center_of_mass", self.model.center_of_mass(y), [data.com[0], data.vcom[0]])
            jacobian = pin.jacobianCenterOfMass(model, data, q) @ s
            compare("center_of_mass_jacobian", self.model.center_of_mass_jacobian(y), jacobian)
            poses, twists = self.model.frame_poses(y), self.model.frame_twists(y)
            responses = self.model.operational_space(y)
            jacobians, drifts = self.model.frame_jacobians(y), self.model.frame_drifts(y)
            pin.forwardKinematics(model, data, q, v, np.zeros(model.nv))
            pin.computeJointJacobians(model, data, q)
            pin.updateFramePlacements(model, data)
            for k, name in enumerate(self.model.frames):
                link = next((link for link in self.links if plain(link) == name), None)
                if link is None:
                    continue  # the base, on which the others are
                frame, local = model.getFrameId(link, pin.FrameType.BODY), pin.ReferenceFrame.LOCAL
                compare("frame_poses", poses[k], data.oMf[frame].homogeneous)
                compare("frame_twists", twists[k], pin.getFrameVelocity(model, data, frame, local).vector[twist])
                jacobian = pin.getFrameJacobian(model, data, frame, local)
                jacobian = jacobian[twist] @ s
                compare("frame_jacobians", jacobians[k], jacobian)
                compare("operational_space", responses[k], jacobian @ np.linalg.solve(mass, jacobian.T))
                drift = pin.getFrameAcceleration(model, data, frame, local).vector[twist]
                compare("frame_drifts", drifts[k], drift)
        return found


def main():
    chosen = sys.argv[1:] or list(ROBOTS)
    place, differs = folder(), False
    for name in chosen:
        path = ROBOTS.get(name, name)
        with tempfile.TemporaryDirectory() as temporary:
            robot = Robot(place / path.removeprefix("+"), path.startswith("+"), pathlib.Path(temporary), more=MORE, bodies=True)
        found = robot.differences(np.random.default_rng(7))
        bad = {what for what, difference in found.items() if not difference < TOLERANCE}
        differs |= bool(bad)
        print(f"{name}: {robot.pin.nv} velocities, {N_STATES} states" + (": DIFFERS" if bad else ""))
        for what, difference in found.items():
            print(f"    {what:26} {difference:.1e}")
    sys.exit(1 if differs else 0)


if __name__ == "__main__":
    main()
