"""Blender add-on: measure, fair, mesh and reflect the active mesh object with torchfair.

Installation: install torchfair into the Python of Blender once,

    "PATH TO BLENDER/5.0/python/bin/python3.11" -m pip install torchfair

then in Blender: Edit, Preferences, Add-ons, Install from Disk, this file. The panel "torchfair" stands in the sidebar
of the 3D view (N). Tested with Blender 5.0.1 as a Python module (``bpy``), without its window.

Lengths are those of the scene: the scale of the object counts. Modifiers do not, what is measured and moved is the
mesh itself; apply them first. Blender stores positions in single precision, so that planar panels are planar to about
1e-7 of the extent of the mesh.
"""

# No "from __future__ import annotations": Blender reads the properties of operators from their annotations.
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING, Any

import bpy
import numpy as np

if TYPE_CHECKING:
    from torch import Tensor

    from torchfair import Topology

bl_info = {
    "name": "torchfair",
    "author": "The torchfair developers",
    "version": (0, 1, 0),
    "blender": (4, 2, 0),
    "location": "3D View > Sidebar > torchfair",
    "description": "Measures and improves the visual smoothness of polyhedral surfaces",
    "category": "Mesh",
}
_VERDICT = "torchfair_verdict"  # property of an object, shown in the panel


def mesh_of(item: Any) -> tuple["Tensor", "Topology"]:
    """Vertices (V, 3) in the space of the scene, and connectivity, of a mesh object.

    Raises:
        torchfair.errors.MeshError: it is no oriented manifold mesh.
    """
    import torch

    from torchfair import Topology

    data = item.data
    points = np.empty(3 * len(data.vertices), np.float32)
    data.vertices.foreach_get("co", points)
    corners = np.empty(len(data.loops), np.int32)
    data.loops.foreach_get("vertex_index", corners)
    sizes = np.empty(len(data.polygons), np.int32)
    data.polygons.foreach_get("loop_total", sizes)
    offsets = np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64)
    topology = Topology.from_packed_faces(corners.astype(np.int64), offsets, len(data.vertices))
    linear, shift = _placement(item)
    return torch.from_numpy(points.reshape(-1, 3).astype(np.float64) @ linear.T + shift), topology


def move_vertices(item: Any, vertices: "Tensor") -> None:
    """Gives the vertices of a mesh object other positions, in the space of the scene."""
    item.data.vertices.foreach_set("co", _local(item, vertices).ravel())
    item.data.update()


def add_object(context: Any, source: Any, vertices: "Tensor", topology: "Topology", name: str) -> Any:
    """A mesh object beside another one, with the same placement; it becomes the active one."""
    data = bpy.data.meshes.new(name)
    data.from_pydata(_local(source, vertices).tolist(), [], topology.face_lists())
    data.update()
    made = bpy.data.objects.new(name, data)
    made.matrix_world = source.matrix_world
    for collection in source.users_collection:
        collection.objects.link(made)
    for other in context.selected_objects:
        other.select_set(False)
    made.select_set(True)
    context.view_layer.objects.active = made
    return made


def selected_vertices(item: Any) -> list[int]:
    """Numbers of the vertices that are selected in edit mode."""
    chosen = np.empty(len(item.data.vertices), np.bool_)
    item.data.vertices.foreach_get("select", chosen)
    return np.flatnonzero(chosen).tolist()


def told_of(vertices: "Tensor", topology: "Topology") -> str:
    """Smoothness and planarity of a mesh in a sentence."""
    from torchfair.measuring import count_meetings, curvature_doubts, measure_mesh, verdict, worst_edges, worst_panels

    values = {quantity.key: quantity.value for quantity in measure_mesh(vertices, topology)}
    measures = {key: value or 0.0 for key, value in values.items()}
    doubts = curvature_doubts({**measures, "self_intersections": count_meetings(vertices, topology)})
    edges, panels = worst_edges(vertices, topology, 1), worst_panels(vertices, topology, 1)
    return " ".join([verdict(values, edges, panels, doubts), *(f"C is not to be trusted: {doubt}" for doubt in doubts)])


def _placement(item: Any) -> tuple[Any, Any]:
    """Linear part (3, 3) and shift (3,) that put a mesh into the scene."""
    matrix = np.array(item.matrix_world, np.float64)
    return matrix[:3, :3], matrix[:3, 3]


def _local(item: Any, vertices: "Tensor") -> Any:
    """Positions (V, 3) in the space of an object, in single precision."""
    linear, shift = _placement(item)
    placed = vertices.detach().cpu().double().numpy() - shift
    return np.ascontiguousarray(np.linalg.solve(linear, placed.T).T, np.float32)


class _Job:
    """What the operators have in common: the active mesh object, and errors of torchfair as reports."""

    bl_options = {"REGISTER", "UNDO"}  # noqa: RUF012 (as Blender wants it)

    @classmethod
    def poll(cls, context: Any) -> bool:
        """Whether there is a mesh object, not in edit mode."""
        item = context.active_object
        return item is not None and item.type == "MESH" and item.mode == "OBJECT"

    def execute(self, context: Any) -> set[str]:
        """Reads the mesh, does the work, says what came of it."""
        try:
            from torchfair.errors import TorchfairError
        except ImportError as error:
            self.report({"ERROR"}, f"torchfair is not installed in the Python of Blender: {error}")
            return {"CANCELLED"}
        item = context.active_object
        if not len(item.data.polygons):
            self.report({"ERROR"}, f"{item.name} has no faces")
            return {"CANCELLED"}
        if np.linalg.matrix_rank(_placement(item)[0]) < 3:
            self.report({"ERROR"}, f"{item.name} is scaled to nothing in some direction")
            return {"CANCELLED"}
        try:
            vertices, topology = mesh_of(item)
            if topology.num_faces > 1 and not topology.num_interior_edges:
                self.report(
                    {"ERROR"}, f"no two faces of {item.name} share an edge: merge its vertices by distance first"
                )
                return {"CANCELLED"}
            words = self.work(context, item, vertices, topology)
        except TorchfairError as error:
            self.report({"ERROR"}, f"{error} (Mesh > Clean Up, Mesh > Normals > Recalculate may mend the mesh)")
            return {"CANCELLED"}
        self.report({"INFO"}, words)
        return {"FINISHED"}


class TORCHFAIR_OT_measure(_Job, bpy.types.Operator):
    """Measure the visual smoothness of the mesh: E over C, planarity, the worst places"""  # noqa: D415

    bl_idname = "torchfair.measure"
    bl_label = "Measure"

    def work(self, context: Any, item: Any, vertices: "Tensor", topology: "Topology") -> str:
        """Keeps the verdict with the object."""
        item[_VERDICT] = told_of(vertices, topology)
        return item[_VERDICT]


class TORCHFAIR_OT_fair(_Job, bpy.types.Operator):
    """Move vertices along the surface so that the mesh becomes as smooth as it can be"""  # noqa: D415

    bl_idname = "torchfair.fair"
    bl_label = "Fair"

    planar: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Planar quads", description="Make all quads planar, too", default=False
    )
    keep_selected: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Keep selected", description="Vertices that are selected in edit mode stay where they are", default=False
    )
    boundary: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Boundary",
        items=[
            ("glide", "Glides", "Boundary vertices slide on smooth curves"),
            ("fixed", "Fixed", "Boundary vertices stay"),
            ("free", "Free", "Boundary vertices may leave their curves"),
        ],
        default="glide",
    )

    def work(self, context: Any, item: Any, vertices: "Tensor", topology: "Topology") -> str:
        """Moves the vertices of the object."""
        from torchfair.errors import MeshError
        from torchfair.formfinding import FairSettings, minimise_normal_variation

        if item.data.shape_keys is not None:
            raise MeshError(f"{item.name} has shape keys: apply or remove them")
        settings = FairSettings(boundary=self.boundary, planar="quads" if self.planar else "keep")
        fixed = selected_vertices(item) if self.keep_selected else []
        found = minimise_normal_variation(vertices, topology, fixed=fixed, settings=settings)
        move_vertices(item, found.vertices)
        item[_VERDICT] = told_of(found.vertices, topology)
        before, after = found.before["normal_variation"], found.after["normal_variation"]
        missed = [str(promise) for promise in found.promises if not promise.holds]
        return " ".join([f"E {before:.4g} -> {after:.4g}.", *missed])


class TORCHFAIR_OT_mesh(_Job, bpy.types.Operator):
    """Make a mesh along the principal curvature directions of the surface, as a new object"""  # noqa: D415

    bl_idname = "torchfair.mesh"
    bl_label = "Principal mesh"

    faces: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Faces", description="About so many faces", default=500, min=4
    )
    triangles: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Triangles", description="Triangles with principal edges in place of quads", default=False
    )

    def work(self, context: Any, item: Any, vertices: "Tensor", topology: "Topology") -> str:
        """Adds the object."""
        from torchfair.meshing import principal_quads, principal_triangles

        made = (principal_triangles if self.triangles else principal_quads)(vertices, topology, count=self.faces)
        name = f"{item.name} {'triangles' if self.triangles else 'quads'}"
        add_object(context, item, made.vertices, made.topology, name)[_VERDICT] = told_of(made.vertices, made.topology)
        return " ".join([f"{made.topology.num_faces} faces.", *made.notes])


class TORCHFAIR_OT_reflect(_Job, bpy.types.Operator):
    """Score the reflections of the mesh against those of a smooth surface, as an image"""  # noqa: D415

    bl_idname = "torchfair.reflect"
    bl_label = "Reflections"

    size: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Size", description="Pixels of each view", default=256, min=32, max=1024
    )

    def work(self, context: Any, item: Any, vertices: "Tensor", topology: "Topology") -> str:
        """Loads the picture into Blender; another object that is selected is the smooth surface."""
        from torchfair.reflection import reflection_score
        from torchfair.viewing import picture_reflections

        others = [other for other in context.selected_objects if other is not item and other.type == "MESH"]
        reference = mesh_of(others[0]) if len(others) == 1 else None
        score = reflection_score(vertices, topology, reference, size=self.size)
        with tempfile.TemporaryDirectory() as folder:
            picture = Path(folder) / "reflections.png"
            picture_reflections(picture, score, item.name)
            image = bpy.data.images.load(str(picture))
            image.pack()
        image.name = f"{item.name} reflections"
        with_what = f"against {others[0].name}" if reference is not None else "against itself, smoothly shaded"
        return f"Score {float(score.score):.4g} {with_what}; see the image '{image.name}' in the image editor."


class TORCHFAIR_PT_panel(bpy.types.Panel):
    """The panel in the sidebar of the 3D view."""

    bl_idname = "TORCHFAIR_PT_panel"
    bl_label = "torchfair"
    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "torchfair"

    def draw(self, context: Any) -> None:
        """The four operators, and the last verdict on the active object."""
        for job in _OPERATORS:
            self.layout.operator(job.bl_idname)
        item = context.active_object
        for part in str(item.get(_VERDICT, "")).split("; ") if item is not None else []:
            self.layout.label(text=part)


_OPERATORS = (TORCHFAIR_OT_measure, TORCHFAIR_OT_fair, TORCHFAIR_OT_mesh, TORCHFAIR_OT_reflect)


def register() -> None:
    """Called by Blender when the add-on is switched on."""
    for kind in (*_OPERATORS, TORCHFAIR_PT_panel):
        bpy.utils.register_class(kind)


def unregister() -> None:
    """Called by Blender when it is switched off."""
    for kind in reversed((*_OPERATORS, TORCHFAIR_PT_panel)):
        bpy.utils.unregister_class(kind)


if __name__ == "__main__":
    register()
