"""Run by a Python with bpy: renders a scene described as JSON with Cycles, and saves its radiance as .npy.

Stands alone: it shares nothing with the package but the numbers in the JSON.
"""

import json
import math
import sys
from pathlib import Path

import bpy
import numpy as np

setting = json.loads(Path(sys.argv[1]).read_text())
target = Path(sys.argv[2])

bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
scene.world = bpy.data.worlds.new("dark")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0.0

# a cap of the eye's sphere, edges of 0.03 mm
radius, extent = setting["radius"], 6.8
ticks = np.linspace(-extent, extent, 455)
x, y = np.meshgrid(ticks, ticks)
z = radius - np.sqrt(radius**2 - x**2 - y**2)
vertices = np.stack([x, y, z], axis=-1).reshape(-1, 3)
n = len(ticks)
corner = (np.arange(n - 1)[:, None] * n + np.arange(n - 1)).ravel()
faces = np.stack([corner, corner + 1, corner + n + 1, corner + n], axis=1)
mesh = bpy.data.meshes.new("retina")
mesh.from_pydata(vertices.tolist(), [], faces.tolist())
mesh.shade_smooth()
material = bpy.data.materials.new("lambertian")
material.use_nodes = True
nodes = material.node_tree.nodes
nodes.clear()
diffuse = nodes.new("ShaderNodeBsdfDiffuse")
diffuse.inputs["Color"].default_value = (setting["albedo"],) * 3 + (1.0,)
diffuse.inputs["Roughness"].default_value = 0.0
output = nodes.new("ShaderNodeOutputMaterial")
material.node_tree.links.new(diffuse.outputs["BSDF"], output.inputs["Surface"])
mesh.materials.append(material)
scene.collection.objects.link(bpy.data.objects.new("retina", mesh))

spot = bpy.data.lights.new("spot", "SPOT")
spot.energy = setting["power_w"]
spot.spot_size = 2.0 * setting["half_angle"]
spot.spot_blend = setting["blend"]
spot.shadow_soft_size = 0.0
lamp = bpy.data.objects.new("spot", spot)
lamp.location = setting["apex"]
axis = np.asarray(setting["axis"])
tilt = math.acos(-axis[2])
lamp.rotation_euler = (0.0, -tilt, math.atan2(axis[1], axis[0]))
scene.collection.objects.link(lamp)

camera = bpy.data.cameras.new("camera")
camera.sensor_fit = "HORIZONTAL"
camera.sensor_width, camera.lens = setting["sensor_width"], setting["focal_length"]
camera.clip_start, camera.clip_end = 1.0, 1000.0
if setting["aperture"] > 0.0:
    camera.dof.use_dof = True
    camera.dof.focus_distance = setting["height"] - setting["focus"]
    # Blender takes its unit of length for a metre, but the focal length in mm
    camera.dof.aperture_fstop = 1e-3 * setting["focal_length"] / setting["aperture"]
eye = bpy.data.objects.new("camera", camera)
eye.location = (0.0, 0.0, setting["height"])
scene.collection.objects.link(eye)
scene.camera = eye

render = scene.render
render.engine = "CYCLES"
render.resolution_x = render.resolution_y = setting["resolution"]
render.resolution_percentage = 100
# only the patch is traced; the rest of the frame stays black
left, top, right, bottom = setting["window"]
render.use_border, render.use_crop_to_border = True, False
render.border_min_x, render.border_max_x = left, right
render.border_min_y, render.border_max_y = 1.0 - bottom, 1.0 - top
render.threads_mode, render.threads = "FIXED", 2
cycles = scene.cycles
cycles.device = "CPU"
cycles.samples = setting["samples"]
cycles.use_adaptive_sampling = cycles.use_denoising = False
cycles.max_bounces = 0
cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0.0
cycles.pixel_filter_type = "BOX"
scene.view_settings.view_transform = "Raw"
render.image_settings.file_format = "OPEN_EXR"
render.image_settings.color_depth = "32"
render.image_settings.exr_codec = "ZIP"
render.filepath = str(target.with_suffix(".exr"))
bpy.ops.render.render(write_still=True)
image = bpy.data.images.load(render.filepath)
image.colorspace_settings.name = "Non-Color"
pixels = np.empty(image.size[0] * image.size[1] * image.channels, np.float32)
image.pixels.foreach_get(pixels)
# Blender's first row is the lowest
np.save(target, pixels.reshape(image.size[1], image.size[0], image.channels)[::-1, :, 0])
