"""Render a flat, semi-infinite medium with Blender Cycles; `benchmarks.blender` runs this text in Blender's Python.

Argument: a JSON list of requests, each a mapping with

    method      of the node Subsurface Scattering, by its identifier
    colour      typed colours of the three channels [-]
    radius      typed radii of the three channels [length], at a scale of 1
    inputs      further inputs of the node [-], set where the method has them
    edge        true: a vertical sun, blocked where x < 0; false: uniform light from all directions
    half_width  half of the width of the picture [length], centred on the edge
    pixels, samples, seed, threads

The camera is orthographic and looks down. Printed is `profilefit: ` and JSON: first the version of Blender, then for
each request the radiance over that of a white Lambertian surface, (3, pixels), or null where there is no such method.
"""

import json
import math
import sys
import tempfile
import warnings
from pathlib import Path

import bpy
import numpy as np

FAR = 100.0  # half of the width of the plane, over that of the picture
ROWS = 4  # of a picture; they are averaged
MARK = "profilefit: "

warnings.simplefilter("ignore", DeprecationWarning)


def plane(name, low, high, half, z):
    """Add a rectangle at height z: x from low to high, y from -half to half."""
    mesh = bpy.data.meshes.new(name)
    corners = [(low, -half, z), (high, -half, z), (high, half, z), (low, half, z)]
    mesh.from_pydata(corners, [], [(0, 1, 2, 3)])
    thing = bpy.data.objects.new(name, mesh)
    bpy.context.scene.collection.objects.link(thing)
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes.clear()
    mesh.materials.append(material)
    return material.node_tree


def shade(tree, kind):
    """Add a closure of this kind to a material, and return it."""
    node = tree.nodes.new(kind)
    output = tree.nodes.new("ShaderNodeOutputMaterial")
    tree.links.new(node.outputs[0], output.inputs["Surface"])
    return node


def build(request):
    """Build the scene of a request."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    far = FAR * request["half_width"]
    node = shade(plane("medium", -far, far, far, 0.0), "ShaderNodeSubsurfaceScattering")
    node.falloff = request["method"]
    node.inputs["Color"].default_value = (*request["colour"], 1.0)
    node.inputs["Scale"].default_value = 1.0
    node.inputs["Radius"].default_value = request["radius"]
    for name, value in request["inputs"].items():
        if name in node.inputs:  # a method shows those that it has
            node.inputs[name].default_value = value
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    background = world.node_tree.nodes["Background"]
    background.inputs["Color"].default_value = (1.0, 1.0, 1.0, 1.0)
    background.inputs["Strength"].default_value = 0.0 if request["edge"] else 1.0
    scene.world = world
    if request["edge"]:
        light = bpy.data.lights.new("sun", "SUN")
        light.energy, light.angle = math.pi, 0.0
        scene.collection.objects.link(bpy.data.objects.new("sun", light))
        blocked = shade(plane("blocker", -far, 0.0, far, 2.0), "ShaderNodeBsdfDiffuse")
        blocked.inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", 2.0 * request["half_width"]
    holder = bpy.data.objects.new("camera", camera)
    holder.location = (0.0, 0.0, 1.0)
    scene.collection.objects.link(holder)
    scene.camera = holder
    return scene


def picture(request):
    """Render a request: (3, pixels)."""
    scene = build(request)
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.seed = request["samples"], request["seed"]
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
    cycles.pixel_filter_type = "BOX"
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = request["pixels"], ROWS, 100
    render.threads_mode, render.threads = "FIXED", request["threads"]
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode, render.image_settings.color_depth = "RGB", "32"
    with tempfile.TemporaryDirectory() as folder:
        render.filepath = str(Path(folder) / "picture.exr")
        bpy.ops.render.render(write_still=True)
        image = bpy.data.images.load(render.filepath)
        values = np.empty(ROWS * request["pixels"] * image.channels, np.float32)
        image.pixels.foreach_get(values)
    return values.reshape(ROWS, request["pixels"], -1)[..., :3].mean(axis=0, dtype=float).T


def methods():
    """Return the identifiers that the node knows."""
    return {
        item.identifier for item in bpy.types.ShaderNodeSubsurfaceScattering.bl_rna.properties["falloff"].enum_items
    }


print(MARK + json.dumps(bpy.app.version_string), flush=True)
for request in json.loads(sys.argv[1]):
    values = picture(request).tolist() if request["method"] in methods() else None
    print(MARK + json.dumps(values), flush=True)
