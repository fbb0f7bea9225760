"""Renders with Cycles: every frame has its own redirection, the node groups look it up as they should, and materials
are set up without breaking what is there."""

import os
import tempfile
from unittest import mock

import numpy as np

from support import Arm, Case, add_mesh, add_texture, bpy, each, load, nodes_of, part, picture, sampled, select, studs


def render():
    """Renders the present frame, and returns its picture, (height, width, 4)."""
    with tempfile.TemporaryDirectory() as folder:
        path = bpy.context.scene.render.filepath = os.path.join(folder, "still.exr")
        bpy.ops.render.render(write_still=True)
        return load(path)


def animation():
    """Renders the scene's frames, and returns the picture of each."""
    scene = bpy.context.scene
    with tempfile.TemporaryDirectory() as folder:
        scene.render.filepath = os.path.join(folder, "frame.")
        bpy.ops.render.render(animation=True)
        frames = range(scene.frame_start, scene.frame_end + 1)
        return {frame: load(os.path.join(folder, f"frame.{frame:04d}.exr")) for frame in frames}


class Scene(Case):
    """A scene that Cycles renders fast, without filters and light."""

    def setUp(self):
        super().setUp()
        scene = bpy.context.scene
        scene.render.engine = "CYCLES"
        scene.cycles.device, scene.cycles.samples = "CPU", 1
        scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
        scene.cycles.pixel_filter_type = "BOX"
        scene.cycles.filter_width = 0.01
        scene.render.resolution_x, scene.render.resolution_y = 96, 64
        scene.render.image_settings.file_format = "OPEN_EXR"
        scene.render.image_settings.color_depth = "32"
        scene.view_settings.view_transform = "Raw"
        scene.frame_start, scene.frame_end = 3, 5

    def camera(self, centre, width):
        data = bpy.data.cameras.new("camera")
        data.type, data.ortho_scale = "ORTHO", width
        camera = bpy.data.objects.new("camera", data)
        camera.location = (*centre, 5)
        bpy.context.collection.objects.link(camera)
        bpy.context.scene.camera = camera

    def material(self, obj, textured=True):
        """Shows an image of the studs as it is, without light; returns the material and the texture's node."""
        material = bpy.data.materials.new("skin")
        tree = nodes_of(material)
        tree.nodes.clear()
        shader, out = tree.nodes.new("ShaderNodeEmission"), tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(shader.outputs[0], out.inputs["Surface"])
        texture = add_texture(picture("albedo", studs(128), is_data=True), shader.inputs["Color"])
        if not textured:
            tree.links.remove(texture.outputs["Color"].links[0])
        obj.data.materials.append(material)
        return material, texture, shader.inputs["Color"]


class Render(Scene):
    def arm(self, tiles=1, size=128):
        arm = Arm.with_studs(tiles=tiles, size=size)
        self.material(arm.object)
        self.camera((1.0, 0.5), 2.2)
        return arm

    @each("by", ("image", "uv_map"))
    @each("persistent", (False, True))
    def test_an_animation_has_each_frames_own_redirection(self, by, persistent):
        bpy.context.scene.render.use_persistent_data = persistent
        arm = self.arm()
        scene, settings = bpy.context.scene, arm.object.vrtm
        with self.set(settings, in_renders=False):
            plain = animation()
        scene.frame_set(1)
        bpy.ops.vrtm.set_up_material(by=by)
        animated = animation()
        # Single frames with the package's own result written by hand, and the add-on out of the way.
        settings.in_renders = False
        asset = arm.asset()
        for frame in (3, 4, 5):
            scene.frame_set(frame)
            asset.solve(arm.pose())
            image = np.zeros((*arm.delta(asset).shape[:2], 4), np.float32)
            image[..., :2], image[..., 3] = arm.delta(asset), 1
            settings.image.pixels.foreach_set(image.ravel())
            settings.image.update_tag()
            arm.mesh.uv_layers["vrtm"].uv.foreach_set("vector", asset.corner_uvs().ravel())
            arm.mesh.update_tag()
            self.assertSame(animated[frame], render())
            self.assertGreater(np.abs(animated[frame] - plain[frame]).max(), 0.3)
        self.assertGreater(np.abs(animated[3] - animated[5]).max(), 0.3)

    @each("persistent", (False, True))
    def test_what_is_carried_is_in_its_place_in_each_frame(self, persistent):
        scene = bpy.context.scene
        scene.render.use_persistent_data = persistent
        arm = Arm.with_studs()
        scene.frame_set(1)
        self.camera((1.0, 0.5), 2.2)
        # A patch of the arm's own faces, as a detail mesh, and a cube.
        patch = add_mesh("patch", arm.rest() * (1, 1.02, 1.02), arm.faces[400:700])
        bpy.ops.mesh.primitive_cube_add(size=0.1, location=(1.3, 0, 0.27))
        cube = bpy.context.object
        for obj in (patch, cube):
            self.material(obj, textured=False)[2].default_value = (*np.random.default_rng(1).random(3), 1)
        for other, operator in ((patch, bpy.ops.vrtm.wrap), (cube, bpy.ops.vrtm.carry)):
            select(other, arm.object)
            self.assertEqual(operator(), {"FINISHED"})
        # Also where the material shows what was baked.
        arm.object.vrtm.shows_baked = persistent
        animated = animation()
        self.assertGreater(np.abs(animated[3] - animated[5]).max(), 0.3)
        # Single frames, with the add-on out of the way.
        arm.object.vrtm.in_renders = False
        for frame in (3, 5, 4):
            self.update(frame)
            bpy.context.view_layer.update()
            self.assertSame(animated[frame], render())

    @each("tiles", (1, 2))
    def test_renders_and_bakes_have_settings_of_their_own(self, tiles):
        arm = self.arm(tiles=tiles, size=64)
        settings, folder = arm.object.vrtm, self.scratch()
        bpy.context.scene.frame_set(5)
        bpy.ops.vrtm.set_up_material()
        expected, size = render(), tuple(settings.image.size)
        for grid, quality in ((32, "draft"), (96, "normal")):
            settings.grid, settings.map_size, settings.quality = grid, 0, quality
            self.update()
            self.assertEqual(tuple(settings.image.size), (grid * tiles, grid))
            self.assertSame(render(), expected)
            self.assertEqual(tuple(settings.image.size), size)
        self.update()
        self.assertEqual(tuple(settings.image.size), (grid * tiles, grid))
        self.bakes_to(folder, 5, 5)
        bpy.ops.vrtm.bake()
        self.assertEqual(load(os.path.join(folder, "arm.redirect.1001.0005.exr")).shape[:2], (64, 64))
        self.update()
        self.assertEqual(self.figures(arm.object)["Grid"], "96 x 96")

    def test_a_render_goes_on_when_there_is_something_wrong(self):
        arm = self.arm()
        bpy.ops.vrtm.set_up_material()
        arm.object.vrtm.mask_source = "VERTEX_GROUP"
        with self.assertLogs("vrtm.blender", "ERROR") as logged:
            render()
        self.assertIn("keeps its last redirection: arm has no vertex group ''", logged.output[0])
        # Also of what is done before the first frame.
        arm.object.vrtm.mask_source, results, session = "NONE", part("results"), part("session")
        with (
            mock.patch.object(results, "separate", side_effect=[RuntimeError("a defect"), None]),
            mock.patch.object(results, "publish", side_effect=lambda *_: self.assertTrue(session.rendering)) as written,
            self.assertLogs("vrtm.blender", "ERROR") as logged,
        ):
            render()
        self.assertEqual((written.call_count, session.rendering, len(logged.output)), (1, False, 1))
        self.assertIn("keeps its last redirection: RuntimeError: a defect", logged.output[0])

    def test_the_group_looks_tiles_up_with_linear_and_extend(self):
        """The redirected UV as a colour, on a plane over UDIM tiles, against the same interpolation in numpy."""
        rng = np.random.default_rng(1)
        for udims, first, columns, rows in (([1001], (0, 0), 1, 1), ([1002, 1013], (1, 0), 2, 2)):
            with self.subTest(udims=udims):
                self.setUp()
                size = 8
                low, high = np.array(first, float), np.array(first, float) + np.array([columns, rows], float)
                corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
                obj = add_mesh("plane", np.pad(corners, ((0, 0), (0, 1))), [(0, 1, 2, 3)], corners)
                layout = part("result_image").Layout.of(udims, size)
                self.assertEqual(layout.numbers(), [*first, columns, rows, size])
                values = np.zeros((layout.height, layout.width, 4), np.float32)
                for udim in udims:
                    values[layout.place(udim)] = rng.uniform(-0.1, 0.1, (size, size, 4))
                values[..., 3] = 1
                part("results").write_image(obj, layout, values)
                material, _, colour = self.material(obj, textured=False)
                tree = material.node_tree
                group, source = tree.nodes.new("ShaderNodeGroup"), tree.nodes.new("ShaderNodeUVMap")
                source.uv_map = "UVMap"
                group.node_tree = part("nodes").group_by_image(obj)
                tree.links.new(source.outputs["UV"], group.inputs["UV"])
                tree.links.new(group.outputs["UV"], colour)
                scene = bpy.context.scene
                side = 40 * max(columns, rows)
                scene.render.resolution_x = scene.render.resolution_y = side
                self.camera(tuple((low + high) / 2), float(max(columns, rows)))
                found = render()[..., :2]
                at = (np.arange(side) + 0.5) / 40
                u, v = np.meshgrid(at + low[0], at + low[1])
                expected = np.stack([u, v], -1) + lookup(values, layout, u, v)
                # Half a pixel's hundredth of jitter, and single precision.
                self.assertLess(np.abs(found - expected).max(), 3e-4)

    def test_materials_are_set_up_and_taken_back(self):
        arm = self.arm()
        obj = arm.object
        material = obj.data.materials[0]
        tree = material.node_tree
        texture = tree.nodes["Image Texture"]
        new = tree.nodes.new

        def image_node(source=None, through=None):
            node = new("ShaderNodeTexImage")
            node.image = texture.image
            if through is not None:
                tree.links.new(source, through.inputs["Vector"])
                source = through.outputs["Vector"]
            if source is not None:
                tree.links.new(source, node.inputs["Vector"])
            return node

        obj.data.uv_layers.new(name="detail")
        coordinates, detail, mapping = new("ShaderNodeTexCoord"), new("ShaderNodeUVMap"), new("ShaderNodeMapping")
        detail.uv_map = "detail"
        mapped = image_node(coordinates.outputs["UV"], mapping)
        direct = image_node(coordinates.outputs["UV"])
        generated = image_node(coordinates.outputs["Generated"])
        other = image_node(detail.outputs["UV"])

        def source(node, name="Vector"):
            return node.inputs[name].links[0].from_node

        self.assertEqual(bpy.ops.vrtm.set_up_material(), {"FINISHED"})
        self.assertEqual(obj.data.materials[0], material)
        group = source(texture)
        # What it read without a link: the map that renders. The node that is there is taken.
        self.assertEqual((group.bl_idname, source(group, "UV")), ("ShaderNodeGroup", coordinates))
        # In front of the mapping, and once for both that begin at the same socket.
        self.assertEqual(source(mapped), mapping)
        self.assertEqual(source(mapping), source(direct))
        self.assertEqual(source(direct).node_tree, group.node_tree)
        self.assertEqual(source(source(direct), "UV"), coordinates)
        self.assertEqual((source(generated), source(other)), (coordinates, detail))
        number = len(tree.nodes)
        # Again: nothing is inserted twice; by UV map, the group is exchanged.
        bpy.ops.vrtm.set_up_material()
        self.assertEqual(len(tree.nodes), number)
        bpy.ops.vrtm.set_up_material(by="uv_map")
        self.assertEqual(len(tree.nodes), number)
        self.assertEqual(source(texture).node_tree["vrtm_kind"], "uv_map")
        bpy.ops.vrtm.clear_material()
        self.assertEqual(source(mapping), coordinates)
        self.assertFalse([node for node in tree.nodes if part("nodes").is_ours(node)])


def lookup(values, layout, u, v):
    """Bilinear, within the tile of each point, with the tile's outermost texels going on to its sides."""
    result = np.zeros((*u.shape, 2))
    local = np.stack([u - layout.first_u, v - layout.first_v], -1)
    tile = np.clip(np.floor(local), 0, (layout.columns - 1, layout.rows - 1))
    for x, y in np.ndindex(layout.columns, layout.rows):
        image = values[layout.place(1001 + layout.first_u + x + 10 * (layout.first_v + y))]
        here = (tile == (x, y)).all(-1)
        result[here] = sampled(image[..., :2], (local - tile)[here])
    return result
