"""Compares random models of MuJoCo with their import, at random states, to 1e-9 of the largest rate.

    pip install mujoco==4.0.0 numpy, and the program `hamel`
    HAMEL=target/debug/hamel python tests/peers/imports.py [FIRST [COUNT]]

A model has bodies in bodies and in frames, with every word for a rotation, joints of all kinds, masses by `inertial` and
by geoms, classes in classes, springs, dampers, motors and servos, joints that follow others, parts of weights that are
held up, flags, and all of `compiler` that concerns them. Joints that follow others are eliminated by the matrix `S` of
their rates, `S^T M (S a + S' u) = S^T f`; friction is that of the imported model, `f tanh(q'/0.01)`. A model that
MuJoCo takes and hamel refuses is told, and one with other rates: exit status 1.
"""

import json
import os
import pathlib
import random
import subprocess
import sys
import tempfile

import mujoco
import numpy as np
from numpy.polynomial import Polynomial

HAMEL = os.environ.get("HAMEL", "hamel")
FREE, BALL = 0, 1
TOLERANCE = 1e-9


class Draw:
    """A model by its number."""

    def __init__(self, seed):
        self.r = random.Random(seed)
        self.in_degrees = self.r.random() < 0.5
        self.n_names = self.n_motions = 0
        self.joints = []

    def chance(self, p, text):
        return text() if self.r.random() < p else ""

    def number(self, size=1.0):
        return repr(round(self.r.uniform(-size, size), self.r.choice([1, 2, 3, 5])))

    def length(self):
        return repr(round(self.r.uniform(0.02, 0.5), 3))

    def angle(self):
        return self.number(90 if self.in_degrees else 1.5)

    def vector(self, n=3):
        entries = [self.r.choice([self.number(), self.number(), "0"]) for _ in range(n)]
        return " ".join(entries)

    def direction(self, n=3):
        while True:
            vector = self.vector(n)
            if any(float(x) for x in vector.split()):
                return vector

    def turn(self):
        kinds = {
            "": lambda: "",
            "quat": lambda: self.r.choice([self.direction(4), "1 0 0 1", "0 1 0 0"]),
            "axisangle": lambda: f"{self.direction()} {self.angle()}",
            "xyaxes": lambda: f"{self.number()} {self.number()} 1 1 {self.number()} {self.number()}",
            "zaxis": self.direction,
            "euler": lambda: f"{self.angle()} {self.angle()} {self.angle()}",
        }
        kind = self.r.choice(list(kinds))
        return f' {kind}="{kinds[kind]()}"' if kind else ""

    def place(self):
        return self.chance(0.5, lambda: f' pos="{self.vector()}"') + self.turn()

    def of_class(self, p=0.3):
        return self.chance(p, lambda: f' class="{self.r.choice(["c1", "c2", "c3"])}"')

    def name(self, prefix):
        self.n_names += 1
        return f"{prefix}{self.n_names}"

    def joint(self, kind):
        name, is_hinge = self.name("q"), kind == "hinge"
        text = f'<joint name="{name}" type="{kind}"{self.of_class()}'
        for attribute, p in [("damping", 0.4), ("armature", 0.3)]:
            text += self.chance(p, lambda: f' {attribute}="{self.length()}"')
        text += self.chance(0.6, lambda: f' pos="{self.vector()}"')
        if kind != "ball":
            self.joints.append(name)
            angle = self.angle if is_hinge else self.number
            text += self.chance(0.3, lambda: f' frictionloss="{self.length()}"')
            text += self.chance(0.3, lambda: f' stiffness="{self.length()}" springref="{angle()}"')
            text += self.chance(0.3, lambda: f' ref="{angle()}"')
            text += self.chance(0.8, lambda: f' axis="{self.direction()}"')
        return text + "/>"

    def geom(self):
        kind = self.r.choice(["sphere", "capsule", "cylinder", "box", "ellipsoid"])
        more = self.r.choice(["", f' mass="{self.length()}"', ' density="300"']) + self.of_class(0.2)
        more += self.chance(0.2, lambda: f' group="{self.r.randint(0, 5)}"')
        if kind != "sphere" and self.r.random() < 0.35:
            ends = f"{self.vector()} {self.number()} 1.5 {self.number()}"
            return f'<geom type="{kind}" size="{self.length()}" fromto="{ends}"{more}/>'
        n = {"sphere": 1, "capsule": 2, "cylinder": 2}.get(kind, 3)
        sizes = " ".join(self.length() for _ in range(n))
        return f'<geom type="{kind}" size="{sizes}"{self.place()}{more}/>'

    def inertial(self):
        a, b = float(self.length()) + 0.1, float(self.length()) + 0.1
        moments = f"{a:.3f} {b:.3f} {a + b - 0.05:.3f}"
        mass = f'<inertial pos="{self.vector()}" mass="{self.length()}"'
        if self.r.random() < 0.3:
            return f'{mass} fullinertia="{moments} .01 -.02 .03"/>'
        return f'{mass} diaginertia="{moments}"{self.turn()}/>'

    def moved(self, is_top):
        """The joints of a body."""
        if self.n_motions >= 4:
            return ""
        if is_top and self.n_motions == 0 and self.r.random() < 0.25:
            self.n_motions = 3
            return self.r.choice(["<freejoint/>", f'<joint{self.of_class()} type="free"/>'])
        if self.n_motions < 2 and self.r.random() < 0.12:
            self.n_motions += 2
            return self.joint("ball")
        n = min(self.r.choice([1, 1, 2] if is_top else [0, 1, 1, 2]), 4 - self.n_motions)
        self.n_motions += n
        return "".join(self.joint(self.r.choice(["hinge", "hinge", "slide"])) for _ in range(n))

    def body(self, depth=0):
        inner = self.moved(depth == 0) + self.chance(0.5, self.inertial) + self.geom()
        inner += self.chance(0.25, lambda: f"<frame{self.place()}>{self.geom()}{self.bodies(depth)}</frame>")
        inner += self.bodies(depth)
        more = self.of_class().replace(" class", " childclass")
        more += self.chance(0.15, lambda: f' gravcomp="{self.length()}"')
        return f'<body name="{self.name("b")}"{self.place()}{more}>{inner}</body>'

    def bodies(self, depth):
        n = self.r.choice([0, 1, 1]) if depth < 2 else 0
        return "".join(self.body(depth + 1) for _ in range(n))

    def defaults(self):
        joint = [f' {a}="{self.length()}"' for a in ("damping", "armature") if self.r.random() < 0.5]
        text = f"<joint{''.join(joint)}/>" + self.chance(0.5, lambda: f'<geom mass="{self.length()}"/>')
        for kind, words in MOTORS.items():
            text += self.chance(0.3, lambda: self.motor(kind, words, ""))
        return text

    def motor(self, kind, words, more):
        said = [f' {w}="{self.length()}"' for w in words if self.r.random() < 0.5]
        if kind == "general":
            said += [f' biastype="affine" biasprm="{self.number()} {self.number()} -0.3"']
        return f"<{kind}{''.join(said)}{more}/>"

    def model(self):
        angle = "degree" if self.in_degrees else "radian"
        compiler = f'<compiler angle="{angle}"'
        axes = "".join(self.r.choice("xyzXYZ") for _ in range(3))
        compiler += self.chance(0.5, lambda: f' eulerseq="{axes}"')
        compiler += self.chance(0.2, lambda: ' inertiafromgeom="true"')
        compiler += self.chance(0.2, lambda: ' inertiagrouprange="0 4"') + "/>"
        option = self.chance(0.4, lambda: f'<option gravity="{self.vector()}"/>')
        flag = self.r.choice(["gravity", "spring", "damper", "frictionloss", "equality", "constraint"])
        option += self.chance(0.2, lambda: f'<option><flag {flag}="disable"/></option>')
        classes = f'<default class="c1">{self.defaults()}<default class="c2">{self.defaults()}</default></default>'
        classes = f'<default>{self.defaults()}{classes}<default class="c3">{self.defaults()}</default></default>'
        tree = self.chance(0.5, self.body) + self.body()
        tree = f"<frame{self.place()}>{tree}</frame>" if self.r.random() < 0.2 else tree
        motors = ""
        for joint in self.joints:
            kind, words = self.r.choice(list(MOTORS.items()))
            more = f' name="{self.name("m")}" joint="{joint}"{self.of_class()}'
            motors += self.chance(0.4, lambda: self.motor(kind, words, more))
        equations = ""
        if len(self.joints) > 1 and self.r.random() < 0.35:
            one, other = self.r.sample(self.joints, 2)
            factors = " ".join(self.r.choice(["0", ".5", "-.25"]) for _ in range(4))
            equations = f'<equality><joint joint1="{one}" joint2="{other}" polycoef="{factors}"/></equality>'
        world = f"<worldbody>{tree}</worldbody>{equations}<actuator>{motors}</actuator>"
        return f'<mujoco model="m">{compiler}{option}{classes}{world}</mujoco>'


MOTORS = {
    "motor": ["gear"],
    "position": ["gear", "kp", "kv"],
    "velocity": ["gear", "kv"],
    "general": ["gear", "gainprm"],
}


def is_off(model, flag):
    return bool(model.opt.disableflags & flag)


def reference(model, rng):
    """A state by names, the rates of its velocities, and controls."""
    bit, kind_of = mujoco.mjtDisableBit, mujoco.mjtObj
    constraint = is_off(model, bit.mjDSBL_CONSTRAINT)
    friction = model.dof_frictionloss * (not (constraint or is_off(model, bit.mjDSBL_FRICTIONLOSS)))
    gravity = model.opt.gravity * (not is_off(model, bit.mjDSBL_GRAVITY))
    followers = {}
    if not (constraint or is_off(model, bit.mjDSBL_EQUALITY)):
        for e in range(model.neq):
            followers[model.eq_obj1id[e]] = (model.eq_obj2id[e], Polynomial(model.eq_data[e, :5]))
    model.opt.disableflags |= bit.mjDSBL_CONSTRAINT | bit.mjDSBL_CONTACT
    data, kinds = mujoco.MjData(model), [int(kind) for kind in model.jnt_type]
    data.qpos[:], data.qvel[:] = rng.uniform(-1, 1, model.nq), rng.uniform(-1, 1, model.nv)
    data.ctrl[:] = rng.uniform(-1, 1, model.nu)
    columns, own = {}, np.zeros(model.nv)
    for j, kind in enumerate(kinds):
        at, place = model.jnt_qposadr[j] + (3 if kind == FREE else 0), model.jnt_dofadr[j]
        if kind in (FREE, BALL):
            data.qpos[at : at + 4] /= np.linalg.norm(data.qpos[at : at + 4])
        if j not in followers:
            columns |= {(j, k): np.eye(model.nv)[place + k] for k in range({FREE: 6, BALL: 3}.get(kind, 1))}
    for j, (leader, p) in followers.items():
        at, place, first = model.jnt_qposadr[j], model.jnt_dofadr[j], model.jnt_qposadr[leader]
        x, rate = data.qpos[first] - model.qpos0[first], data.qvel[model.jnt_dofadr[leader]]
        data.qpos[at], data.qvel[place] = model.qpos0[at] + p(x), p.deriv()(x) * rate
        columns[leader, 0][place], own[place] = p.deriv()(x), p.deriv(2)(x) * rate**2
    data.qfrc_applied[:] = -friction * np.tanh(data.qvel / 0.01)
    mujoco.mj_forward(model, data)
    mass = np.zeros((model.nv, model.nv))
    for k, unit in enumerate(np.eye(model.nv)):
        mujoco.mj_mulM(model, data, mass[k], unit)
    s = np.array(list(columns.values())).T
    a = dict(zip(columns, np.linalg.solve(s.T @ mass @ s, s.T @ (data.qfrc_smooth - mass @ own))))
    state, rates, n_free = {}, {}, kinds.count(FREE)
    for j, kind in enumerate(kinds):
        q, v, name = model.jnt_qposadr[j], model.jnt_dofadr[j], mujoco.mj_id2name(model, kind_of.mjOBJ_JOINT, j)
        if j in followers:
            continue
        if kind not in (FREE, BALL):
            state[name], state[f"{name}_dot"], rates[f"{name}_dot"] = data.qpos[q], data.qvel[v], a[j, 0]
            continue
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, data.qpos[q + (3 if kind == FREE else 0) :][:4])
        turn = turn.reshape(3, 3)
        if kind == BALL:
            for k in range(3):
                state |= {f"{name}{k + 1}{n + 1}": turn[k, n] for n in range(3)}
                state[f"{name}_rate{k + 1}"], rates[f"{name}_rate{k + 1}"] = data.qvel[v + k], a[j, k]
            continue
        spin, velocity = data.qvel[v + 3 : v + 6], turn.T @ data.qvel[v : v + 3]
        moved = turn.T @ [a[j, k] for k in range(3)] - np.cross(spin, velocity)
        body = mujoco.mj_id2name(model, kind_of.mjOBJ_BODY, model.jnt_bodyid[j])
        ending = "" if n_free == 1 else f"_{body}"
        vertical = "up" if n_free == 1 else f"vertical{ending}"
        for k in range(3):
            state[f"Omega{ending}{k + 1}"], rates[f"Omega{ending}{k + 1}"] = spin[k], a[j, 3 + k]
            state[f"V{ending}{k + 1}"], rates[f"V{ending}{k + 1}"] = velocity[k], moved[k]
        if gravity.any():
            up = -gravity / np.linalg.norm(gravity)
            state |= {f"{vertical}{k + 1}": (turn.T @ up)[k] for k in range(3)}
            state[f"height{ending}"] = data.qpos[q : q + 3] @ up
    controls = {mujoco.mj_id2name(model, kind_of.mjOBJ_ACTUATOR, k): data.ctrl[k] for k in range(model.nu)}
    return state, rates, controls


def called(arguments, text=None):
    return subprocess.run([HAMEL, *arguments], input=text, capture_output=True, text=True, check=False)


def compared(seed, folder):
    """What is told of a model; nothing where rates agree, or MuJoCo refuses it."""
    text = Draw(seed).model()
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError:
        return None
    path = folder / "m.xml"
    path.write_text(text)
    imported = called(["import", path, "--limits", "none"])
    if imported.returncode:
        return f"refused: {imported.stderr}"
    # Springs of a ball are told.
    if "of joint" in imported.stderr and "is not taken" in imported.stderr:
        return None
    state, rates, controls = reference(model, np.random.default_rng(seed))
    own = imported.stdout.rstrip()[:-1] + "    scene bare { want rhs; }\n}\n"
    for name, value in controls.items():
        own = own.replace(f"input ctrl_{name} = 0;", f"input ctrl_{name} = {float(value)!r};")
    path = folder / "m.hamel"
    path.write_text(own)
    request = json.dumps({"states": [{name: float(value) for name, value in state.items()}]})
    answer = called(["eval", path, "--scene", "bare", "--no-cache"], request)
    if answer.returncode:
        return f"no rates: {answer.stderr}"
    answer = json.loads(answer.stdout)
    found = dict(zip(answer["state"], answer["derivatives"][0]))
    # Some models do not move but by gravity along an axis.
    scale = max([abs(rate) for rate in rates.values()] + [1e-3])
    difference = max(abs(found[name] - rate) for name, rate in rates.items()) / scale
    return None if difference < TOLERANCE else f"rates differ by {difference:.1e}"


def main():
    first, count = [int(x) for x in sys.argv[1:3]] + [0, 50][len(sys.argv) - 1 :]
    n_told = 0
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(first, first + count):
            told = compared(seed, pathlib.Path(folder))
            if told:
                n_told += 1
                print(f"model {seed}: {told}\n{Draw(seed).model()}")
    print(f"{count} models, {n_told} told")
    sys.exit(n_told > 0)


main()
