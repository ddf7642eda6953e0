"""How models and motions show themselves in a notebook.

Deliberately does not know: how figures are drawn.
"""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ._fit import Fit
    from ._linear import Linearization
    from ._model import Model
    from ._results import Motion


def of_model(model: Model, equations: str) -> str:
    """Title, parameters and equations."""
    rows = "".join(
        f"<tr><td><code>{escape(name)}</code></td><td>{value!r}</td><td>{escape(model.params.meaning(name))}</td></tr>"
        for name, value in model.params.items()
    )
    state = ", ".join(f"<code>{escape(name)}</code>" for name in model.state)
    return (
        f"<p><b>{escape(model.title or model.name)}</b> (<code>{escape(model.name)}</code>, scene "
        f"<code>{escape(model.scene)}</code>)</p><table><tbody>{rows}</tbody></table><p>State: {state}</p>{equations}"
    )


def of_motion(motion: Motion) -> str:
    """The curves, and the motion in space where the model says what to draw."""
    # A frame has names and scripts of its own, so that a notebook may show many.
    page = motion.moving()
    moving = ""
    if page is not None:
        moving = (
            f'<iframe title="{escape(motion.model.title, quote=True)}" srcdoc="{escape(page, quote=True)}" '
            'style="width: 100%; height: 720px; border: 0" sandbox="allow-scripts"></iframe>'
        )
    return moving + _picture(motion.svg(), repr(motion))


def of_linearization(linear: Linearization) -> str:
    """The point with its rates, the matrices with names at rows and columns, and the eigenvalues."""
    parts = [
        ("A = df/dy", linear.state, linear.state, linear.A),
        ("B = df/du", linear.state, linear.inputs, linear.B),
        ("C = dh/dy", linear.outputs, linear.state, linear.C),
        ("D = dh/du", linear.outputs, linear.inputs, linear.D),
    ]
    points = [_row(["", "y0", "f"], "th")]
    points += [
        _row([_code(name), f"{y:.6g}", f"{f:.6g}"]) for name, y, f in zip(linear.state, linear.y, linear.rates)
    ]
    points += [_row([_code(name), f"{u:.6g}", ""]) for name, u in zip(linear.inputs, linear.u)]
    text = f"<p><b>Linear system of {escape(linear.model.title or linear.model.name)}</b></p>{_table(points)}"
    for title, rows, columns, matrix in parts:
        if matrix.size:
            lines = [_row([title, *map(_code, columns)], "th")]
            lines += [_row([_code(name), *(f"{x:.6g}" for x in numbers)]) for name, numbers in zip(rows, matrix)]
            text += _table(lines)
    eigenvalues = ", ".join(f"{z.real:.6g}" if z.imag == 0 else f"{z:.6g}" for z in linear.eigenvalues)
    return f"{text}<p>Eigenvalues of A: {eigenvalues}</p>"


def _row(cells: list[str], kind: str = "td") -> str:
    return "<tr>" + "".join(f"<{kind}>{cell}</{kind}>" for cell in cells) + "</tr>"


def _table(rows: list[str]) -> str:
    return f"<table><tbody>{''.join(rows)}</tbody></table>"


def _code(name: str) -> str:
    return f"<code>{escape(name)}</code>"


def of_fit(fit: Fit) -> str:
    """Unknowns with standard errors and correlations, residuals of each column, the verdict, and the figure."""
    from ._fit import told

    names = [_code(name) for name in fit.values]
    unknowns = [
        _row([name, escape(told(fit.values[own], fit.errors[own])), *(f"{x:.3f}" for x in correlations)])
        for name, own, correlations in zip(names, fit.values, fit.correlation)
    ]
    columns = [
        _row([_code(name), str(fit.json["columns"][name]["values"]), f"{rms:.3e}"])
        for name, rms in fit.rms.items()
    ]
    converted = "".join(f"<br/>{escape(line)}" for line in fit.converted)
    return (
        f"<p><b>Fit of {escape(fit.model.title or fit.model.name)}</b> (<code>{escape(fit.model.name)}</code>, scene "
        f"<code>{escape(fit.model.scene)}</code>): {escape(fit.verdict)}{converted}</p>"
        + _table([_row(["", "value", *names], "th"), *unknowns])
        + _table([_row(["", "values", "rms left"], "th"), *columns])
        + _picture(fit.svg(), repr(fit))
    )


def _picture(svg: str, meaning: str) -> str:
    # A picture, because identifiers within one page would meet those of another figure.
    picture = base64.b64encode(svg.encode()).decode()
    return f'<img alt="{escape(meaning, quote=True)}" src="data:image/svg+xml;base64,{picture}"/>'
