"""Writes reference_mujoco.txt: rates of the models beside this file, by MuJoCo.

pip install mujoco
python codegen/tests/robots/reference_mujoco.py

A line is a robot, its state and controls by names, and the rates of its velocities: `qacc` without contacts, limits and
equations between joints. A joint that follows another one, `q = p(x)`, is eliminated by the matrix S of its rates,
`S^T M (S a + S' u) = S^T f`; friction is that of the imported model, `f tanh(q'/0.01)`. The velocity of a free joint is
in space, that of the model in the body: `V = R^T v`, `V' = R^T v' - Omega x V`.
"""

import pathlib

import mujoco
import numpy as np

here = pathlib.Path(__file__).parent
rng = np.random.default_rng(39)
lines = []
FREE, BALL = 0, 1


def word(name):
    return "".join(c if c.isalnum() else "_" for c in name)


def named(model, kind, k):
    return mujoco.mj_id2name(model, kind, k)


def joint_names(model):
    names = []
    for j in range(model.njnt):
        body = model.jnt_bodyid[j]
        of_body = named(model, mujoco.mjtObj.mjOBJ_BODY, body) or f"body{body}"
        k = j - model.body_jntadr[body]
        own = named(model, mujoco.mjtObj.mjOBJ_JOINT, j)
        names.append(word(own or f"{of_body}_joint" + ("" if k == 0 else str(k + 1))))
    return names


for robot in ["crane", "flock", "rover", "stick"]:
    model = mujoco.MjModel.from_xml_path(str(here / f"{robot}.xml"))
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT | mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    joints = joint_names(model)
    kinds = [int(kind) for kind in model.jnt_type]
    n_free = kinds.count(FREE)
    gravity = model.opt.gravity.copy()
    if model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_GRAVITY:
        gravity[:] = 0
    control = rng.uniform(-1, 1, model.nu)
    followers = {}
    for e in range(model.neq):
        if int(model.eq_type[e]) == mujoco.mjtEq.mjEQ_JOINT and model.eq_active0[e]:
            followers[model.eq_obj1id[e]] = (model.eq_obj2id[e], model.eq_data[e, :5].copy())
    for _ in range(4):
        mujoco.mj_resetData(model, data)
        data.qpos[:] = rng.uniform(-1, 1, model.nq)
        data.qvel[:] = rng.uniform(-1, 1, model.nv)
        data.ctrl[:] = control
        for j, kind in enumerate(kinds):
            if kind in (FREE, BALL):
                at = model.jnt_qposadr[j] + (3 if kind == FREE else 0)
                data.qpos[at : at + 4] /= np.linalg.norm(data.qpos[at : at + 4])
        columns, own_rates = {}, np.zeros(model.nv)
        for j, kind in enumerate(kinds):
            for k in range({FREE: 6, BALL: 3}.get(kind, 1)):
                if j not in followers:
                    columns[j, k] = np.zeros(model.nv)
                    columns[j, k][model.jnt_dofadr[j] + k] = 1
        for j, (leader, coefficients) in followers.items():
            polynomial = np.polynomial.Polynomial(coefficients)
            at, place = model.jnt_qposadr[leader], model.jnt_dofadr[j]
            x, rate = data.qpos[at] - model.qpos0[at], data.qvel[model.jnt_dofadr[leader]]
            own = model.jnt_qposadr[j]
            data.qpos[own] = model.qpos0[own] + polynomial(x)
            data.qvel[place] = polynomial.deriv()(x) * rate
            columns[leader, 0][place] = polynomial.deriv()(x)
            own_rates[place] = polynomial.deriv(2)(x) * rate**2
        data.qfrc_applied[:] = -model.dof_frictionloss * np.tanh(data.qvel / 0.01)
        mujoco.mj_forward(model, data)
        mass = np.zeros((model.nv, model.nv))
        for k, unit in enumerate(np.eye(model.nv)):
            mujoco.mj_mulM(model, data, mass[k], unit)
        s = np.array(list(columns.values())).T
        a = dict(zip(columns, np.linalg.solve(s.T @ mass @ s, s.T @ (data.qfrc_smooth - mass @ own_rates))))
        state, rates = {}, {}
        for j, kind in enumerate(kinds):
            name, q, v = joints[j], model.jnt_qposadr[j], model.jnt_dofadr[j]
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
            body = word(named(model, mujoco.mjtObj.mjOBJ_BODY, model.jnt_bodyid[j]))
            ending = "" if n_free == 1 else f"_{body}"
            for k in range(3):
                state[f"Omega{ending}{k + 1}"], rates[f"Omega{ending}{k + 1}"] = spin[k], a[j, 3 + k]
                state[f"V{ending}{k + 1}"], rates[f"V{ending}{k + 1}"] = velocity[k], moved[k]
            if gravity.any():
                up = -gravity / np.linalg.norm(gravity)
                vertical = "up" if n_free == 1 else f"vertical{ending}"
                state |= {f"{vertical}{k + 1}": (turn.T @ up)[k] for k in range(3)}
                state[f"height{ending}"] = data.qpos[q : q + 3] @ up
        for k in range(model.nu):
            own = named(model, mujoco.mjtObj.mjOBJ_ACTUATOR, k) or joints[model.actuator_trnid[k, 0]]
            state[f"ctrl_{word(own)}"] = control[k]
        told = [" ".join(f"{key}={float(value)!r}" for key, value in values.items()) for values in (state, rates)]
        lines.append(f"{robot} | {told[0]} | {told[1]}")
(here / "reference_mujoco.txt").write_text("\n".join(lines) + "\n")
