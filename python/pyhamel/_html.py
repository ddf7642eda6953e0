"""How models and motions show themselves in a notebook.

Deliberately does not know: how figures are drawn.
"""

from __future__ import annotations

import base64
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
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
    # A picture, because identifiers within one page would meet those of another figure.
    picture = base64.b64encode(motion.svg().encode()).decode()
    return f'{moving}<img alt="{escape(repr(motion), quote=True)}" src="data:image/svg+xml;base64,{picture}"/>'
