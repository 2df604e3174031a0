"""The shader source of a law: written, run on a GPU, and compared with the law that it was made of."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # as in `profilefit`: a name is imported on first use
if TYPE_CHECKING:
    from profilefit.shader.check.evaluate import ShaderLaw
    from profilefit.shader.check.laws import check_law
    from profilefit.shader.context import open_context, opened, renderer
    from profilefit.shader.emit import law_text
    from profilefit.shader.law_file import export
else:
    __getattr__ = attributes(
        __name__,
        {
            "ShaderLaw": "check.evaluate",
            "check_law": "check.laws",
            **dict.fromkeys(("open_context", "opened", "renderer"), "context"),
            "law_text": "emit",
            "export": "law_file",
        },
    )

__all__ = ["ShaderLaw", "check_law", "export", "law_text", "open_context", "opened", "renderer"]
