"""The shader source of a law: written, run on a GPU, and compared with the law that it was made of."""

from mcml_sim.cli.lazy import attributes

TYPE_CHECKING = False  # as in `profilefit`: a name is imported on first use
if TYPE_CHECKING:
    from profilefit.shader.check.law_check import check_law
    from profilefit.shader.check.shader_law import ShaderLaw
    from profilefit.shader.context import open_context, opened, renderer
    from profilefit.shader.emit import law_text
    from profilefit.shader.law_file import export
else:
    __getattr__, __dir__ = attributes(
        __name__,
        {
            "ShaderLaw": "check.shader_law",
            "check_law": "check.law_check",
            **dict.fromkeys(("open_context", "opened", "renderer"), "context"),
            "law_text": "emit",
            "export": "law_file",
        },
    )

__all__ = ["ShaderLaw", "check_law", "export", "law_text", "open_context", "opened", "renderer"]
