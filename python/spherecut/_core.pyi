"""Types of the compiled module; python/make_stubs.py writes this file."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, Optional, Union

import numpy as np
import numpy.typing as npt

class InputError(ValueError):
    """Input that cannot be used. The message says what, where, the value and the limit: the same words as on the
    command line, which exits with status 2.
    """

class OutputError(InputError):
    """Results that cannot be written. The message has the path and the system's reason."""

class NumericalError(ArithmeticError):
    """A computation that failed on valid input. The message has the node, or the residual and condition: the same
    words as on the command line, which exits with status 3.
    """

def set_thread_count(count: int) -> None:
    """Threads that assembly and evaluation may use, the calling one included: 1 to 256, 1 unless set. Results do not
    depend on it.
    """

def thread_count() -> int:
    """Threads that assembly and evaluation may use."""

class Surface:
    """A triangulated surface that does not change: vertices, m, and triangles."""
    def __init__(self, vertices: npt.ArrayLike, triangles: npt.NDArray[Any]) -> None:
        """vertices: (n, 3), m. triangles: (m, 3) numbers of vertices, counter-clockwise seen from outside. Both are
        copied. Nothing but ranges is checked: check_surface() mends what comes from elsewhere.
        """
    @property
    def vertices(self) -> npt.NDArray[Any]:
        """(n, 3), m; the surface's own memory, cannot be written to."""
    @property
    def triangles(self) -> npt.NDArray[Any]:
        """(m, 3) numbers of vertices; the surface's own memory, cannot be written to."""
    @property
    def volume(self) -> float:
        """Enclosed volume, m3; negative when oriented inwards."""
    @property
    def area(self) -> float:
        """Area, m2."""
    @property
    def bounds(self) -> npt.NDArray[Any]:
        """(2, 3), m: least and greatest coordinates."""
    def vertex_normals(self) -> npt.NDArray[Any]:
        """(n, 3) unit normals at the vertices, weighted by area."""
    def neighbours(self) -> npt.NDArray[Any]:
        """(m, 3): for every triangle those across its edges v0v1, v1v2, v2v0; -1 on a border."""
    def write(self, file: Union[str, PathLike[str]]) -> None:
        """Writes OBJ or PLY, by the extension."""

class CheckedSurface:
    """A surface that mechanics can stand on: closed, 2-manifold, outward, free of self-intersections; and what was
    done to make it so.
    """
    @property
    def surface(self) -> Surface:
        """The surface (a copy)."""
    @property
    def mended(self) -> list[str]:
        """A sentence for every kind of mending."""
    @property
    def warnings(self) -> list[str]:
        """About a surface that is sound but looks unintended."""

def check_surface(vertices: npt.ArrayLike, polygons: Any, name: str = 'surface', pieces: str = 'refuse', cavities: str = 'keep') -> CheckedSurface:
    """Checks and mends polygons from anywhere. vertices: (n, 3), m. polygons: (m, k) numbers of vertices, or a list of
    lists. name: starts every error. pieces: 'refuse', 'largest' or 'all'. cavities: 'keep', 'fill' or 'refuse'.
    Raises InputError with the place of what cannot be mended.
    """

def read_surface(file: Union[str, PathLike[str]], scale: float = 1.0, pieces: str = 'refuse', cavities: str = 'keep') -> CheckedSurface:
    """check_surface() of an OBJ, PLY, STL, OFF, VTK or VTP file. scale: metres in a unit of the file."""

def label_surface(labels: npt.NDArray[Any], origin: npt.ArrayLike, axes: npt.ArrayLike, label: Optional[int] = None, name: str = 'labels') -> CheckedSurface:
    """Surface of the voxels of one label of a segmentation. labels: (i, j, k) whole numbers. origin: (3,), m, centre
    of voxel (0, 0, 0). axes: (3, 3), m; its columns lead from a voxel to the next along i, j and k. label: None
    takes the only one but 0. (SimpleITK's arrays are (k, j, i): transpose them.)
    """

def make_block(lower: npt.ArrayLike, upper: npt.ArrayLike, edge: float) -> Surface:
    """Surface of a box between two corners, (3,), m; edge: of its triangles, m."""

def make_cylinder(radius: float, height: float, edge: float) -> Surface:
    """Surface of an upright cylinder on z = 0 about the z axis; all in m."""

def make_hemisphere(radius: float, edge: float) -> Surface:
    """Surface of a half ball on z = 0 with its pole at +z; all in m."""

def make_liver(triangles: int = 20000) -> Surface:
    """Surface of a liver of adult size, 0.22 m wide, about 1.6 litres, dome at +z; 1000 to 500000 triangles."""

class Domain:
    """A closed solid at rest: what mechanics needs to know of geometry. Several threads may ask it."""
    @staticmethod
    def box(lower: npt.ArrayLike, upper: npt.ArrayLike, edge: float) -> Domain:
        """Box between two corners, (3,), m, with exact planes; edge: of the triangles of its surface, m."""
    @staticmethod
    def turned_box(centre: npt.ArrayLike, axes: npt.ArrayLike, half_size: npt.ArrayLike, edge: float) -> Domain:
        """Box of edges 2 half_size, (3,), m, about centre, (3,), m, along the columns of axes, (3, 3), a rotation."""
    @staticmethod
    def hemisphere(radius: float, edge: float) -> Domain:
        """Half ball on z = 0 with its pole at +z; m."""
    @staticmethod
    def cylinder(radius: float, height: float, edge: float) -> Domain:
        """Upright cylinder on z = 0; m."""
    @staticmethod
    def organ(surface: Surface, voxel_size: float = 0.0) -> Domain:
        """Solid within a checked closed surface. voxel_size: m, of the level set that gives distances away from the
        surface; 0: 1/128 of the largest extent.
        """
    def signed_distance(self, points: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n,), m, negative inside, at points, (n, 3), m."""
    def normal(self, points: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n, 3): unit gradient of signed_distance at points, (n, 3), m."""
    def closest_surface_point(self, points: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n, 3), m: the nearest points of the surface to points, (n, 3), m."""
    @property
    def surface(self) -> Surface:
        """The surface as triangles (a copy)."""
    @property
    def bounds(self) -> npt.NDArray[Any]:
        """(2, 3), m: least and greatest coordinates."""

class Region:
    """A part of space: what of a body's surface is held, what nodes are meant."""
    @staticmethod
    def box(lower: npt.ArrayLike, upper: npt.ArrayLike) -> Region:
        """Between two corners, (3,), m."""
    @staticmethod
    def sphere(centre: npt.ArrayLike, radius: float) -> Region:
        """Within radius, m, of the centre, (3,), m."""
    @staticmethod
    def half_space(point: npt.ArrayLike, normal: npt.ArrayLike) -> Region:
        """Behind the plane through point, (3,), m; normal, (3,), points out of the region."""
    def holds(self, points: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n,) of bool: which of the points, (n, 3), m, lie in it; to 1e-9 m, bounds included."""

class ToolPose:
    """Where a tool is: its reference point and the direction from there into the tool."""
    def __init__(self, point: npt.ArrayLike, axis: npt.ArrayLike = ...) -> None:
        """point: (3,), m. axis: (3,), of any length, away from the tissue."""
    @property
    def point(self) -> npt.NDArray[Any]:
        """(3,), m."""
    @property
    def axis(self) -> npt.NDArray[Any]:
        """(3,), unit."""

class Tool:
    """A rigid tool."""
    @staticmethod
    def sphere_tip(radius: float) -> Tool:
        """A ball, radius in m; its reference point is the lowest along the axis."""
    @staticmethod
    def flat_punch(radius: float, length: float = 0.05) -> Tool:
        """A flat cylinder, m; its reference point is the centre of the flat end."""
    @staticmethod
    def laparoscope(tip_radius: float, shaft_radius: float, shaft_length: float, port: npt.ArrayLike) -> Tool:
        """A spherical tip on a shaft that pivots on a port, (3,), m."""
    def pose_at(self, point: npt.ArrayLike, axis: npt.ArrayLike = ...) -> ToolPose:
        """The pose with the reference point at point, (3,), m; a laparoscope takes its axis from its port."""
    def distance(self, pose: ToolPose, points: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n,), m: signed distance of points, (n, 3), m, from the tool, negative inside."""
    def mesh(self, pose: ToolPose, edge: float) -> Surface:
        """Closed surface of the tool with edges of about edge m."""

class SurfaceContact:
    """Where a tool is deepest in an organ's surface at rest, or nearest to it."""
    @property
    def point(self) -> npt.NDArray[Any]:
        """(3,), m, on the surface."""
    @property
    def normal(self) -> npt.NDArray[Any]:
        """(3,) unit, outward there."""
    @property
    def depth(self) -> float:
        """m; above 0: the tool is in the organ, below: clearance."""
    @property
    def triangle(self) -> int:
        """Number of the triangle that holds the point."""
    @property
    def tool_point(self) -> npt.NDArray[Any]:
        """(3,), m: the point of the tool's skeleton that is deepest."""

class ContactQuery:
    """Finds where tools touch one closed surface. Several threads may ask it."""
    def __init__(self, surface: Surface) -> None:
        ...
    def first_touch(self, tool: Tool, pose: ToolPose) -> SurfaceContact:
        """Searches the whole surface."""
    def walk(self, tool: Tool, pose: ToolPose, last: SurfaceContact) -> SurfaceContact:
        """The same contact, found from the last one on; the nearer, the faster."""

def disc_sheet(centre: npt.ArrayLike, normal: npt.ArrayLike, radius: float, edge: float) -> Surface:
    """Disc as the sheet of a cut. centre: (3,), m. normal: (3,), to its + side. radius, edge of triangles: m."""

def rectangle_sheet(centre: npt.ArrayLike, normal: npt.ArrayLike, up: npt.ArrayLike, width: float, height: float, edge: float) -> Surface:
    """Rectangle as the sheet of a cut: height m along up, width m along normal x up."""

def polygon_sheet(corners: npt.ArrayLike, edge: float) -> Surface:
    """Simple polygon in one plane as the sheet of a cut. corners: (n, 3), m, counter-clockwise from its + side."""

def read_sheet(file: Union[str, PathLike[str]], scale: float = 1.0) -> Surface:
    """Sheet from a surface file, open or closed, mended. scale: metres in its unit."""

class FrontFrame:
    """A point of the front of a cut with the directions there."""
    @property
    def point(self) -> npt.NDArray[Any]:
        """(3,), m."""
    @property
    def ahead(self) -> npt.NDArray[Any]:
        """(3,) unit, in the sheet's tangent plane, out of it: where the front would grow."""
    @property
    def normal(self) -> npt.NDArray[Any]:
        """(3,) unit, to the + side of the sheet."""
    @property
    def tangent(self) -> npt.NDArray[Any]:
        """(3,) unit, along the front: normal x ahead."""
    @property
    def distance(self) -> float:
        """m, from the point that was asked about."""
    @property
    def segment(self) -> int:
        """Row of Incision.front."""

class Incision:
    """All sheets of a cut at one moment, in the body at rest. It does not change; several threads may ask it."""
    def __init__(self, sheets: Sequence[Surface], domain: Domain) -> None:
        ...
    @property
    def sheets(self) -> list[Any]:
        """List of Surface (copies)."""
    @property
    def front(self) -> npt.NDArray[Any]:
        """(n, 2, 3), m: pieces of the border of the sheets inside the body."""
    @property
    def front_sheets(self) -> npt.NDArray[Any]:
        """(n,): the sheet of each row of front."""
    @property
    def area(self) -> float:
        """m2, of the sheets inside the body."""
    @property
    def front_length(self) -> float:
        """m."""
    def blocks(self, a: npt.ArrayLike, b: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n,) of bool: whether a sheet lies between points a and b, (n, 3) or (3,), m: sight lines. Touching counts."""
    def closest(self, points: npt.ArrayLike, reach: float) -> dict[str, Any]:
        """Nearest points of the sheets within reach m of points, (n, 3), m: dict of point (n, 3), normal (n, 3),
        distance (n,), sheet (n,), triangle (n,); distance is inf and sheet -1 where there is none.
        """
    def front_frame(self, point: npt.ArrayLike, reach: float) -> Optional[FrontFrame]:
        """FrontFrame of the nearest point of the front within reach m of point, (3,), or None."""
    def detour(self, x: npt.ArrayLike, y: npt.ArrayLike, reach: float) -> Optional[tuple[float, npt.NDArray[Any]]]:
        """Shortest way around the front between points that do not see each other, no longer than reach m: its length,
        m, and the point of the front, (3,), m; or None.
        """

class BladeSweep:
    """A blade drawn through a body, and the sheets that its edge sweeps, in the body at rest."""
    def __init__(self, edge: npt.ArrayLike, domain: Domain, triangle_edge: float = 0.002, edge_radius: float = 0.0001) -> None:
        """edge: (n, 3), m, a polyline in the blade's frame. triangle_edge: m, of the sheets' triangles."""
    def move_to(self, time: float, position: npt.ArrayLike, orientation: npt.ArrayLike = ..., to_rest: Any = None) -> dict[str, Any]:
        """Moves the blade's frame to position, (3,), m, turned by orientation: (3, 3), a rotation, or (4,), a unit
        quaternion w, x, y, z. The first call only places it. to_rest: function from a point of the deformed body to
        its place at rest, both (3,), m. Returns a dict: triangles added, their area, m2, and refused, why none
        were.
        """
    def lift(self) -> None:
        """The next motion only places the blade."""
    @property
    def sheets(self) -> list[Any]:
        """List of Surface (copies)."""
    @property
    def incision(self) -> Incision:
        """The sheets as an Incision."""
    @property
    def edge_at_rest(self) -> npt.NDArray[Any]:
        """(n, 3), m: where the edge is in the body at rest; empty before the first pose."""

def grow_front(incision: Incision, motion: Callable[..., Any], edge: float) -> dict[str, Any]:
    """Moves the front by motion(FrontFrame), (3,), m, and fills what it sweeps with triangles of about edge m. Returns
    a dict: sheets, each continued, triangles added, and their area, m2.
    """

class Wound:
    """The surface of an organ after a cut: closed and 2-manifold, with lips and walls at every sheet."""
    @property
    def vertices(self) -> npt.NDArray[Any]:
        """(n, 3), m; the wound's own memory, as the other arrays, cannot be written to."""
    @property
    def triangles(self) -> npt.NDArray[Any]:
        """(m, 3) numbers of vertices."""
    @property
    def surface(self) -> Surface:
        """The same as a Surface (a copy)."""
    @property
    def part(self) -> npt.NDArray[Any]:
        """(m,): 0 organ, 1 wall of the material on the + side of its sheet, 2 on the - side."""
    @property
    def sheet(self) -> npt.NDArray[Any]:
        """(m,): the sheet of a wall, -1 on the organ."""
    @property
    def source_triangle(self) -> npt.NDArray[Any]:
        """(m,): the triangle of the organ or of the sheet that it is part of."""
    @property
    def piece(self) -> npt.NDArray[Any]:
        """(m,): the piece of material that it bounds."""
    @property
    def point(self) -> npt.NDArray[Any]:
        """(n,): copies of one point of the cut share a number."""
    @property
    def evaluation(self) -> npt.NDArray[Any]:
        """(n, 3), m: where a field is evaluated for a vertex, moved off the walls into its side."""
    @property
    def volumes(self) -> npt.NDArray[Any]:
        """(pieces,), m3."""
    def lip_pairs(self) -> npt.NDArray[Any]:
        """(k, 2): vertices of facing walls at one place, on the + and on the - side."""

def cut_surface(organ: Surface, sheets: Sequence[Surface]) -> Wound:
    """Wound of sheets in the closed surface of an organ."""

class IncrementalWound:
    """A wound that follows growing sheets."""
    def __init__(self, organ: Surface) -> None:
        ...
    def grow(self, sheets: Sequence[Surface]) -> dict[str, Any]:
        """The sheets now: each begins with the triangles it had, new sheets follow the old. Returns a dict: triangles
        crossed and rebuilt.
        """
    @property
    def wound(self) -> Wound:
        """The Wound now (a copy)."""

class NodeKind:
    """What a node is: the numbers in Nodes.kinds."""
    INTERIOR: NodeKind
    SURFACE: NodeKind
    EDGE: NodeKind
    LIP: NodeKind
    def __init__(self, value: int) -> None: ...
    def __int__(self) -> int: ...

class Nodes:
    """Nodes of a body at rest. They do not change; the arrays are their own memory."""
    def __init__(self, positions: npt.ArrayLike, spacings: npt.ArrayLike, kinds: npt.NDArray[Any], normals: Optional[npt.ArrayLike] = None, reaches: Optional[npt.ArrayLike] = None) -> None:
        """positions: (n, 3), m. spacings, reaches: (n,), m. kinds: (n,) numbers of NodeKind. normals: (n, 3) unit,
        outward at surface and edge nodes. All are copied.
        """
    def __len__(self) -> int:
        ...
    @property
    def positions(self) -> npt.NDArray[Any]:
        """(n, 3), m."""
    @property
    def spacings(self) -> npt.NDArray[Any]:
        """(n,), m."""
    @property
    def reaches(self) -> npt.NDArray[Any]:
        """(n,), m: radii of the spheres are multiples of it."""
    @property
    def normals(self) -> npt.NDArray[Any]:
        """(n, 3) unit, outward at surface and edge nodes, out of its face at a lip node; zero inside."""
    @property
    def kinds(self) -> npt.NDArray[Any]:
        """(n,) of uint8: numbers of NodeKind."""
    def on_surface(self) -> npt.NDArray[Any]:
        """(n,) of bool: nodes of the body's own surface, sharp edges included."""
    def lip_partners(self) -> npt.NDArray[Any]:
        """(n,): the node across the sheet from a lip node, -1 where there is none."""

class Spacing:
    """Spacing of nodes that grows with the distance from fine zones: clamp(fine + slope (distance - plateau fine),
    fine, coarse).
    """
    def __init__(self, fine: float, coarse: Optional[float] = None, slope: float = 0.3, radius: float = 0.0, plateau: float = 1.5, centres: Optional[npt.ArrayLike] = None, segments: Optional[npt.ArrayLike] = None) -> None:
        """fine, coarse: m; coarse None: fine everywhere. slope: m per m. radius: m, about each of centres, (n, 3), m.
        segments: (n, 2, 3), m, along which it is fine. With neither it is coarse everywhere.
        """
    @property
    def fine(self) -> float:
        """m."""
    @property
    def coarse(self) -> float:
        """m."""
    def __call__(self, points: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n,), m, at points, (n, 3), m."""

class Sprinkling:
    """Nodes as they were sprinkled, and what was checked about them."""
    @property
    def nodes(self) -> Nodes:
        """Nodes (a copy)."""
    @property
    def zones(self) -> list[Any]:
        """List of dicts, one for each band of spacing: spacing_from, spacing_to, m; nodes; nearest_min,
        nearest_median, in spacings; expected number; density, about 1.
        """
    @property
    def kept_from(self) -> npt.NDArray[Any]:
        """(n,): number of each node in the cloud before, -1 for a new one; empty but after resprinkle()."""

def sprinkle(domain: Domain, spacing: Spacing, seeds: Optional[npt.ArrayLike] = None, random_seed: int = 1, incision: Optional[Incision] = None, ring_ahead: bool = False) -> Sprinkling:
    """Fills a domain with nodes. seeds: (n, 3), m, surface nodes that stand where they are put. The same random_seed
    gives the same bits. incision: nodes stand in pairs on the faces of the cut. ring_ahead: nodes ahead of its
    front too, which method 'collocation' wants. Raises NumericalError where a zone stays under-filled.
    """

def resprinkle(domain: Domain, spacing: Spacing, previous: Nodes, seeds: Optional[npt.ArrayLike] = None, random_seed: int = 1, incision: Optional[Incision] = None, ring_ahead: bool = False) -> Sprinkling:
    """The same after the fine zone has moved: every node of previous that still fits stays."""

def expected_count(domain: Domain, spacing: Spacing, incision: Optional[Incision] = None) -> float:
    """Number of nodes to expect of sprinkle(), within 10 %."""

def spacing_for_count(domain: Domain, spacing: Spacing, count: int) -> Spacing:
    """spacing with fine and coarse scaled so that there are about count nodes."""

def front_segments(incision: Incision, length: float) -> npt.NDArray[Any]:
    """(n, 2, 3), m: the front in straight pieces of at most length m, for Spacing(segments=...)."""

class Material:
    """Isotropic linear elasticity."""
    def __init__(self, young_modulus: float, poisson_ratio: float, density: float = 1060.0) -> None:
        """young_modulus: E, Pa. poisson_ratio: nu, 0 to below 0.5. density: kg/m3, for weight alone."""
    @property
    def young_modulus(self) -> float:
        """E, Pa."""
    @property
    def poisson_ratio(self) -> float:
        """nu."""
    @property
    def density(self) -> float:
        """kg/m3."""
    @property
    def shear_modulus(self) -> float:
        """mu, Pa."""
    @property
    def lame_lambda(self) -> float:
        """Pa."""

class PointValues:
    """What a field is at n points. The arrays are its own memory."""
    @property
    def displacement(self) -> npt.NDArray[Any]:
        """(n, 3), m."""
    @property
    def gradient(self) -> npt.NDArray[Any]:
        """(n, 3, 3): du_i/dx_j."""
    @property
    def strain(self) -> npt.NDArray[Any]:
        """(n, 3, 3)."""
    @property
    def stress(self) -> npt.NDArray[Any]:
        """(n, 3, 3), Pa."""
    def von_mises(self) -> npt.NDArray[Any]:
        """(n,), Pa."""

class Field:
    """A solution of a body. It can be scaled and added to others of the same body."""
    @property
    def coefficients(self) -> npt.NDArray[Any]:
        """(n, 3), m: nodal coefficients, of which displacements are sums; the field's own memory."""
    @property
    def pressure(self) -> npt.NDArray[Any]:
        """(n,), Pa, of a body that has pressures; else empty."""
    @property
    def load_factor(self) -> float:
        """Multiple of the body's loads that acts."""
    def plus(self, other: Field, factor: float = 1.0) -> Field:
        """self + factor * other. Raises InputError for a field of another body."""

class Held:
    """A part of a body's surface whose displacement is given."""
    def __init__(self, region: Any, components: Sequence[bool] = [True, True, True], displacement: Any = None) -> None:
        """region: a Region, or a function of x, (3,), m, and normal, (3,), that tells whether the surface is held
        there. components: which axes are held. displacement: (3,), m, or a function of x; None: zero.
        """

class Body:
    """A body, discretised and factored once, for any number of solutions. One thread works with it at a time; others
    wait.
    """
    def __init__(self, domain: Domain, nodes: Nodes, material: Material, held: Sequence[Held], *, body_force: Any = None, traction: Any = None, lip_traction: Any = None, initial_strain: Optional[npt.ArrayLike] = None, incision: Optional[Incision] = None, method: str = 'galerkin', sight: str = 'enriched', unheld: str = 'refuse', support_radius: float = 0.0, cell_size: float = 0.75, cut_ahead: bool = False, touched_from: Optional[npt.ArrayLike] = None) -> None:
        """held: list of Held. body_force: N/m3, (3,) or a function of x. traction: Pa on the surface, (3,) or a
        function of x and normal. lip_traction: Pa on the faces of the cut, the same; the normal points into the
        cut. initial_strain: (3, 3), stress-free strain; pre-tension is negative. method: 'galerkin', 'collocation'
        or 'published'. sight: 'visibility', 'diffraction', 'enriched' or 'appended'. unheld, of pieces that nothing
        holds: 'refuse', 'hold' or 'drop'. support_radius, in spacings; 0: the method's own. cell_size, in spacings.
        cut_ahead: the body is compared with cut ones. touched_from: (3,) towards the tool. Raises InputError for a
        problem that cannot be used, NumericalError naming the node or the condition.
        """
    def solve(self) -> Field:
        """Field under loads and given displacements, without a tool."""
    def at(self, points: npt.ArrayLike, field: Field) -> PointValues:
        """PointValues of the field at points, (n, 3), m. Raises InputError for a point that no sphere covers."""
    def nodal_displacements(self, field: Field) -> npt.NDArray[Any]:
        """(n, 3), m, at the nodes."""
    def contact_displacements(self, nodes: npt.NDArray[Any], field: Field) -> npt.NDArray[Any]:
        """(k, 3), m: conjugate to a force on each node: with 'galerkin' the mean over its share."""
    def force_response(self, nodes: npt.NDArray[Any], forces: npt.ArrayLike) -> Field:
        """Field of forces, (k, 3), N, on nodes, (k,), without the body's own loads."""
    def constraint_forces(self, field: Field) -> npt.NDArray[Any]:
        """(k, 3), N, on the body, of every entry that is held; see held_nodes."""
    @property
    def held_nodes(self) -> npt.NDArray[Any]:
        """(k,): the node of every entry that is held."""
    def load_work(self, field: Field) -> float:
        """J: work of the loads on the displacements of the field."""
    def residual(self, field: Field, nodes: Optional[npt.NDArray[Any]] = None, forces: Optional[npt.ArrayLike] = None) -> float:
        """Largest unbalanced force over the largest force, under the loads and forces, (k, 3), N, on nodes, (k,)."""
    @property
    def nodes(self) -> Nodes:
        """Nodes (a copy)."""
    @property
    def material(self) -> Material:
        """Material."""
    @property
    def method(self) -> str:
        """Name of the method."""
    @property
    def report(self) -> dict[str, Any]:
        """dict: nodes, unknowns, matrix_nonzeros, factor_nonzeros, condition_estimate, worst_moment_condition, pieces,
        and seconds of supports, assembly and factor.
        """

class Law:
    """A hyperelastic law: strain energy and stress as functions of the deformation gradient F, (3, 3), at finite
    strain. The built-in ones raise InputError for constants with which they are not stable.
    """
    @staticmethod
    def linear(shear_modulus: float, bulk_modulus: float) -> Law:
        """Small strain: W = mu dev e : dev e + kappa/2 (tr e)^2. Moduli: Pa."""
    @staticmethod
    def neo_hookean(shear_modulus: float, bulk_modulus: float) -> Law:
        """W = mu/2 (J^(-2/3) tr F^T F - 3) + U(J), U = kappa/4 (J^2 - 1 - 2 ln J). Moduli: Pa."""
    @staticmethod
    def yeoh(c1: float, c2: float, c3: float, bulk_modulus: float) -> Law:
        """W = c1 (I - 3) + c2 (I - 3)^2 + c3 (I - 3)^3 + U(J), I = J^(-2/3) tr F^T F. All in Pa."""
    @staticmethod
    def ogden(terms: npt.ArrayLike, bulk_modulus: float) -> Law:
        """W = sum of mu_p/alpha_p (l1^alpha_p + l2^alpha_p + l3^alpha_p - 3) + U(J), l the stretches times J^(-1/3).
        terms: (1 to 3, 2) of mu_p, Pa, and alpha_p.
        """
    @staticmethod
    def holzapfel_gasser_ogden(shear_modulus: float, fibre_modulus: float, fibre_exponent: float, directions: npt.ArrayLike, bulk_modulus: float, dispersion: float = 0.0) -> Law:
        """The neo-Hookean law with one or two families of fibres, which bear tension alone. fibre_modulus: k1, Pa.
        fibre_exponent: k2. directions: (1 or 2, 3), or (3,). dispersion: 0 to 1/3.
        """
    @staticmethod
    def of_functions(energy: Any, stress: Any = None, tangent: Any = None, *, bulk_modulus: float = 0.0, name: str = 'functions', many: bool = True) -> Law:
        """A law from functions of F, (n, 3, 3), det F > 0. energy: W, (n,), J/m3; inf where the law cannot be asked.
        stress: first Piola stress dW/dF, (n, 3, 3), Pa. tangent: dP_ij/dF_kl, (n, 3, 3, 3, 3), Pa. Without tangent
        it is made by central differences of the stress, without stress that by differences of the energy, of fourth
        order in steps of 1e-3, off by 1e-9 of the shear modulus or so (docs/python.md). many=False: the functions
        get one F, (3, 3), at a time. bulk_modulus: kappa, Pa; above 0, U(J) = kappa/4 (J^2 - 1 - 2 ln J) is added,
        and near nu = 0.5 bodies take the pressure of blocks. Functions are called with the interpreter's lock, on
        any thread; what they raise comes out. Raises InputError where they do not fit each other at six strained
        states, or F = 1 bears a stress; later for values that are not finite, with F and the place in the body.
        """
    def energy(self, gradients: npt.ArrayLike) -> npt.NDArray[Any]:
        """W, (n,), J/m3 of the body at rest, at F, (n, 3, 3) or (3, 3); inf where det F <= 0."""
    def stress(self, gradients: npt.ArrayLike) -> npt.NDArray[Any]:
        """First Piola stress, (n, 3, 3), Pa, at F, (n, 3, 3) or (3, 3)."""
    def tangent(self, gradients: npt.ArrayLike) -> npt.NDArray[Any]:
        """dP_ij/dF_kl, (n, 3, 3, 3, 3), Pa, at F, (n, 3, 3) or (3, 3)."""
    @property
    def shear_modulus(self) -> float:
        """mu at rest, Pa; without fibres."""
    @property
    def bulk_modulus(self) -> float:
        """kappa at rest, Pa."""
    @property
    def young_modulus(self) -> float:
        """E at rest, Pa."""
    @property
    def poisson_ratio(self) -> float:
        """nu at rest."""
    @property
    def name(self) -> str:
        """As in a scenario, or as given."""

class FiniteValues:
    """What a body at finite strain is at n points; the arrays are its memory."""
    @property
    def displacement(self) -> npt.NDArray[Any]:
        """(n, 3), m."""
    @property
    def deformation(self) -> npt.NDArray[Any]:
        """(n, 3, 3): F."""
    @property
    def first_piola(self) -> npt.NDArray[Any]:
        """(n, 3, 3), Pa: P = dW/dF."""
    @property
    def cauchy(self) -> npt.NDArray[Any]:
        """(n, 3, 3), Pa: P F^T / J."""
    @property
    def jacobian(self) -> npt.NDArray[Any]:
        """(n,): J = det F."""
    @property
    def energy(self) -> npt.NDArray[Any]:
        """(n,), J/m3 of the body at rest: W."""

class FiniteBody:
    """A body of a Law at finite strain. Its states are coefficients, (n, 3), m, of which displacements are sums; an
    Equilibrium finds them. One thread works with it at a time; others wait.
    """
    def __init__(self, domain: Domain, nodes: Nodes, law: Law, held: Sequence[Held], *, body_force: Any = None, traction: Any = None, lip_traction: Any = None, incision: Optional[Incision] = None, sight: str = 'enriched', support_radius: float = 1.75, cell_size: float = 0.75, quadrature: int = 2, pointwise_modulus: float = 2.5) -> None:
        """held: list of Held. body_force: N per m3 of the body at rest, (3,) or a function of x. traction: Pa on the
        surface at rest, (3,) or a function of x and normal; lip_traction: the same on the faces of the cut. Loads
        keep their direction. sight: 'visibility', 'diffraction', 'enriched' or 'appended'. support_radius,
        cell_size: in spacings. quadrature: rule of a cell, 1 to 3. pointwise_modulus: of the part of the pressure
        that is taken point by point, over the shear modulus. Raises InputError and NumericalError as Body.
        """
    def evaluate(self, coefficients: npt.ArrayLike) -> tuple[float, npt.NDArray[Any]]:
        """Strain energy, J, and internal forces, (n, 3), N, its slope by the coefficients; inf and zero where the law
        cannot be asked.
        """
    def at(self, points: npt.ArrayLike, coefficients: npt.ArrayLike) -> FiniteValues:
        """FiniteValues at points of the body at rest, (n, 3), m. Raises InputError for a point that no sphere covers."""
    def nodal_displacements(self, coefficients: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n, 3), m, at the nodes."""
    @property
    def loads(self) -> npt.NDArray[Any]:
        """(n, 3), N: forces of the loads on the coefficients."""
    @property
    def prescribed(self) -> npt.NDArray[Any]:
        """(k, 3), m: the given displacement of every entry that is held; see held_nodes."""
    @property
    def held_nodes(self) -> npt.NDArray[Any]:
        """(k,): the node of every entry that is held."""
    @property
    def nodes(self) -> Nodes:
        """Nodes (a copy)."""
    @property
    def law(self) -> Law:
        """Law."""
    @property
    def pointwise_share(self) -> float:
        """Share of the volumetric energy that is taken point by point; 1: no blocks."""
    @property
    def volume(self) -> float:
        """m3, of the points of integration."""

class EquilibriumStatus:
    """How an equilibrium was found."""
    @property
    def iterations(self) -> int:
        """Of all steps."""
    @property
    def evaluations(self) -> int:
        """Of the energy."""
    @property
    def steps(self) -> int:
        """Parts that the way was gone in."""
    @property
    def halvings(self) -> int:
        """Of steps."""
    @property
    def factorisations(self) -> int:
        """Of the tangent."""
    @property
    def residual(self) -> float:
        """Norm of the unbalanced forces over the acting ones."""
    @property
    def least_jacobian(self) -> float:
        """Least det F of all points."""
    @property
    def energy(self) -> float:
        """J, strain energy."""
    @property
    def touching(self) -> int:
        """Nodes that touch the tool."""
    @property
    def penetration(self) -> float:
        """Of the tool, in spacings, left over."""
    @property
    def tool_force(self) -> npt.NDArray[Any]:
        """(3,), N, of the body on the tool."""
    @property
    def tool_torque(self) -> npt.NDArray[Any]:
        """(3,), N m, of the same about the tool's point."""

class Equilibrium:
    """Equilibria of a FiniteBody along a way of loads, given displacements and poses of a tool."""
    def __init__(self, body: FiniteBody, *, method: str = 'quasi_newton', tolerance: float = 0.001, maximum_iterations: int = 100, halvings: int = 6, least_jacobian: float = 0.01, penetration: float = 0.001, fall_back: bool = True) -> None:
        """method: 'quasi_newton' or 'newton'. tolerance: of the unbalanced forces over the acting ones.
        maximum_iterations: of a step, which is then halved. halvings: of a step, before Newton's method is asked,
        if fall_back. least_jacobian: where a search stops short. penetration: of the tool, in spacings.
        """
    def set_contact(self, tool: Tool, nodes: npt.NDArray[Any], condition: str = 'frictionless', friction: float = 0.0) -> None:
        """The tool that presses, and the surface nodes, (m,), it may touch. condition: 'frictionless', 'frictional'
        with Coulomb's coefficient friction, or 'bonded'.
        """
    def take_hold(self, tool: Tool, pose: ToolPose, nodes: npt.NDArray[Any]) -> None:
        """A tool at that pose holds these surface nodes, (m,), from now on: they move with it as with a rigid body."""
    def let_go(self) -> None:
        """There is no tool any more."""
    def solve(self, pose: Optional[ToolPose] = None, load_factor: float = 1.0, prescribed: Optional[npt.ArrayLike] = None) -> EquilibriumStatus:
        """Goes from the present state to equilibrium. pose: of the tool. load_factor: of the body's loads. prescribed:
        (k, 3), m, of every entry that is held; None: the body's own. Raises NumericalError where there is none to
        be found, and what a function of the law raises: the state is then what it was before.
        """
    @property
    def coefficients(self) -> npt.NDArray[Any]:
        """(n, 3), m, of the state (a copy)."""
    def set_coefficients(self, coefficients: npt.ArrayLike, load_factor: float = 0.0) -> None:
        """Begins from these, (n, 3), m, as from a state with that part of the loads."""
    @property
    def constraint_forces(self) -> npt.NDArray[Any]:
        """(k, 3), N, on the body, of every entry that is held."""
    @property
    def contact_forces(self) -> npt.NDArray[Any]:
        """(m, 3), N, on the body at every node that the tool may touch; empty without a tool."""

class ContactPatch:
    """A body seen from nodes that a tool may touch: displacement = base + compliance * force."""
    @property
    def nodes(self) -> npt.NDArray[Any]:
        """(m,) numbers of nodes."""
    @property
    def rest(self) -> npt.NDArray[Any]:
        """(m, 3), m, at rest."""
    @property
    def normals(self) -> npt.NDArray[Any]:
        """(m, 3) unit, outward."""
    @property
    def compliance(self) -> npt.NDArray[Any]:
        """(3m, 3m), m/N; the patch's own memory."""
    @property
    def base_displacement(self) -> npt.NDArray[Any]:
        """(m, 3), m, without a tool."""

def condense(body: Body, nodes: npt.NDArray[Any]) -> ContactPatch:
    """ContactPatch of surface nodes, (m,), none of them held."""

class ContactState:
    """Outcome of pressing a tool into a patch."""
    @property
    def force(self) -> npt.NDArray[Any]:
        """(3,), N, of the body on the tool."""
    @property
    def torque(self) -> npt.NDArray[Any]:
        """(3,), N m, of the same forces about the tool's point, each where its node is now; of prescribe() about the
        origin.
        """
    def torque_about(self, point: npt.ArrayLike) -> npt.NDArray[Any]:
        """(3,), N m, about another point, (3,), m."""
    @property
    def nodal_forces(self) -> npt.NDArray[Any]:
        """(m, 3), N, on the body; the state's own memory."""
    @property
    def active(self) -> npt.NDArray[Any]:
        """(m,) of bool: nodes in contact."""
    @property
    def displacement(self) -> npt.NDArray[Any]:
        """(m, 3), m, of the patch's nodes."""
    @property
    def centre(self) -> npt.NDArray[Any]:
        """(3,), m: mean place of the contact at rest, weighted by normal force."""
    @property
    def contact_radius(self) -> float:
        """m."""
    @property
    def largest_penetration(self) -> float:
        """m, left over."""
    @property
    def active_nodes(self) -> int:
        """Nodes in contact."""
    @property
    def iterations(self) -> int:
        """Linearisations of the tool's surface."""
    @property
    def converged(self) -> bool:
        """Whether the contact was found."""
    @property
    def friction_work(self) -> float:
        """J, on the way from the state before."""

class LipState:
    """Which pairs of lips are closed, and their forces."""
    @property
    def forces(self) -> npt.NDArray[Any]:
        """(entries,), N."""
    @property
    def openings(self) -> npt.NDArray[Any]:
        """(entries,), m; the normal one of a pair comes first."""
    @property
    def closed(self) -> npt.NDArray[Any]:
        """(pairs,) of bool."""
    @property
    def converged(self) -> bool:
        """Whether the contact was found."""

class CutContactState:
    """Tool and lips in contact together."""
    @property
    def tool(self) -> ContactState:
        """ContactState."""
    @property
    def lips(self) -> LipState:
        """LipState."""

def press(patch: ContactPatch, tool: Tool, pose: ToolPose, condition: str = 'frictionless', friction: float = 0.0, previous: Optional[ContactState] = None) -> ContactState:
    """Presses a tool: no penetration, no tension. condition: 'frictionless', 'frictional' with Coulomb's coefficient
    friction, or 'bonded'. previous: state to go on from, of the same patch.
    """

def prescribe(patch: ContactPatch, displacements: npt.ArrayLike) -> ContactState:
    """ContactState with given displacements, (m, 3), m, of all nodes of the patch."""

def deform(patch: ContactPatch, state: ContactState) -> Field:
    """Field of the body in a contact."""

class LipPatch:
    """A cut body seen from the pairs of nodes on the faces of its cut."""
    @property
    def pairs(self) -> npt.NDArray[Any]:
        """(p, 2) numbers of nodes, on the + and on the - side of the sheet."""
    @property
    def normals(self) -> npt.NDArray[Any]:
        """(p, 3) unit, from the - side to the + side."""
    @property
    def compliance(self) -> npt.NDArray[Any]:
        """(entries, entries), m/N: opening per pair force."""
    @property
    def base_opening(self) -> npt.NDArray[Any]:
        """(entries,), m, without tool and pair forces."""

def condense_lips(body: Body, condition: str = 'frictionless', patch: Optional[ContactPatch] = None) -> LipPatch:
    """LipPatch of all pairs of a cut body. condition: 'frictionless' or 'sticking'. patch: of the tool, if there is
    one.
    """

def close_lips(lips: LipPatch, tolerance: float = 1e-09) -> LipState:
    """LipState under the body's own loads: no pair goes through itself by more than tolerance m, and none pulls."""

def press_with_lips(patch: ContactPatch, lips: LipPatch, tool: Tool, pose: ToolPose, condition: str = 'frictionless', friction: float = 0.0, previous: Optional[CutContactState] = None) -> CutContactState:
    """press() with the contact of the lips found at the same time. lips: condensed with patch."""

def deform_with_lips(patch: ContactPatch, lips: LipPatch, state: CutContactState) -> Field:
    """Field of the body in a contact of tool and lips."""

def deform_closed(lips: LipPatch, state: LipState) -> Field:
    """Field of the body under its own loads with its lips in contact."""

def front_samples(incision: Incision, spacing: float, margin: float = 0.0) -> list[FrontFrame]:
    """List of FrontFrame about spacing m apart along the front, no nearer than margin m to the body's surface."""

def interaction_integral(body: Body, field: Field, front: FrontFrame) -> npt.NDArray[Any]:
    """(3,): K_I, K_II, K_III, Pa sqrt(m), at a place of the front by the interaction integral. Raises InputError where
    its tube leaves the body.
    """

def displacement_correlation(body: Body, field: Field, front: FrontFrame) -> npt.NDArray[Any]:
    """(3,): K_I, K_II, K_III, Pa sqrt(m), from the jump of the displacement behind the front."""

def energy_release_rate(material: Material, k: npt.ArrayLike) -> float:
    """G, J/m2, of intensities, (3,), Pa sqrt(m)."""

def kink_angle(k: npt.ArrayLike) -> float:
    """Angle, rad, in which a front with intensities, (3,), Pa sqrt(m), runs on: largest hoop stress."""

class FrontState:
    """A place of the front: what drives a tear there, and what resists it."""
    @property
    def frame(self) -> FrontFrame:
        """FrontFrame."""
    @property
    def intensities(self) -> npt.NDArray[Any]:
        """(3,): K_I, K_II, K_III, Pa sqrt(m)."""
    @property
    def release(self) -> float:
        """G, J/m2."""
    @property
    def toughness(self) -> float:
        """G_c there, J/m2."""
    @property
    def angle(self) -> float:
        """rad; 0 ahead, positive to the + side of the sheet."""
    @property
    def by_integral(self) -> bool:
        """False: by the jump behind the front."""

def front_states(body: Body, field: Field, toughness: Any, spacing: float) -> list[FrontState]:
    """List of FrontState about spacing m apart along the whole front. toughness: G_c, J/m2, a number or a function of
    a point of the body at rest, (3,), m.
    """

def averaged(material: Material, states: Sequence[FrontState], length: float) -> list[FrontState]:
    """The states with intensities averaged along the front over about length m."""

def directed(states: Sequence[FrontState], toughness: Any, probe: float, direction: str = 'weakest') -> list[FrontState]:
    """The states turned to where the tissue gives way: 'weakest' looks at the toughness probe m ahead, 'hoop_stress'
    does not. toughness: as front_states().
    """

def tear_motion(states: Sequence[FrontState], longest: float, smoothing: float) -> Any:
    """Function of a FrontFrame: how the front moves there, (3,), m, for grow_front(). It moves where G >= G_c, by up
    to longest m; directions and lengths are averaged over smoothing m.
    """

def seed_radius(material: Material, toughness: float, strength: float) -> float:
    """m: radius of the penny crack that a strength, Pa, and a toughness, J/m2, ask for together."""

def averaged_stress(body: Body, field: Field, point: npt.ArrayLike, radius: float) -> tuple[float, npt.NDArray[Any]]:
    """Largest principal stress, Pa, of the mean over a ball of radius m about point, (3,), m, and its direction, (3,)."""

def scenario_keys() -> list[Any]:
    """Every key of a scenario in the order of docs/scenario.md: dicts of texts with path ('fixed[].lower'), type,
    unit, allowed, default, meaning, when ('shape = block': only beside that).
    """

class Scenario:
    """A scenario as its file has it; every key: docs/scenario.md."""
    @staticmethod
    def read(file: Union[str, PathLike[str]]) -> Scenario:
        """Reads and checks a file. Raises InputError with a line for every offence, as spherecut check does."""
    @staticmethod
    def from_text(text: str, file: Union[str, PathLike[str]] = 'scenario.toml') -> Scenario:
        """The same from a text in TOML; files that it names are looked for beside file, which need not exist."""
    @property
    def text(self) -> str:
        """The text in TOML."""
    @property
    def file(self) -> str:
        """Name of the file."""
    @property
    def title(self) -> str:
        """Its title."""
    @property
    def material(self) -> Material:
        """Material."""
    @property
    def toughness(self) -> float:
        """G_c, J/m2; 0: not given."""
    @property
    def method(self) -> str:
        """Name of the method."""
    @property
    def tool(self) -> Optional[Tool]:
        """Tool, or None."""
    @property
    def blade_edge(self) -> Optional[npt.NDArray[Any]]:
        """(n, 3), m, in the blade's frame; None without a blade."""
    def toughness_at(self, points: npt.ArrayLike) -> npt.NDArray[Any]:
        """(n,), J/m2: toughness with its layers at points, (n, 3), m, of the body at rest."""
    @property
    def random_seed(self) -> int:
        """Of its nodes."""
    def with_random_seed(self, seed: int) -> Scenario:
        """The same scenario with other nodes: nodes.random_seed. Its text stays what it was."""
    def with_toughness(self, toughness: Any) -> Scenario:
        """The same scenario with another toughness, J/m2: a number, or a function of a point of the body at rest,
        (3,), m. Blade and tears meet it in every session; a function is asked on the threads of the session. Its
        text stays what it was, and it cannot be pickled.
        """
    def with_law(self, law: Law) -> Scenario:
        """The same scenario with another law, a Law, at finite strain: sessions press, grasp and cut it, under its
        weight, and raise InputError for a scenario that asks for more. Its text stays what it was, and it cannot be
        pickled.
        """

class BladePose:
    """Where the frame of a blade is at a time."""
    def __init__(self, time: float, position: npt.ArrayLike, orientation: npt.ArrayLike = ...) -> None:
        """time: s. position: (3,), m. orientation: (3, 3), a rotation, or (4,), a unit quaternion w, x, y, z."""
    @property
    def time(self) -> float:
        """s."""
    @property
    def position(self) -> npt.NDArray[Any]:
        """(3,), m."""
    @property
    def orientation(self) -> npt.NDArray[Any]:
        """(4,): unit quaternion w, x, y, z."""

class Step:
    """One moment of a run: where tool and blade are."""
    def __init__(self, time: float, tool: Optional[ToolPose] = None, blade: Optional[BladePose] = None) -> None:
        """time: s. tool: ToolPose. blade: BladePose."""
    @property
    def time(self) -> float:
        """s."""
    @property
    def tool(self) -> Optional[ToolPose]:
        """ToolPose, or None."""
    @property
    def blade(self) -> Optional[BladePose]:
        """BladePose, or None where it is not on its way."""

class StepResult:
    """Outcome of one step."""
    @property
    def time(self) -> float:
        """s."""
    @property
    def force(self) -> npt.NDArray[Any]:
        """(3,), N, of the organ on the tool."""
    @property
    def torque(self) -> npt.NDArray[Any]:
        """(3,), N m, of the organ on the tool about its reference point, the outermost point of its tip."""
    @property
    def tangential(self) -> npt.NDArray[Any]:
        """(3,), N: the part of it along the surface."""
    @property
    def blade_force(self) -> npt.NDArray[Any]:
        """(3,), N, of the tissue on the blade; zero where the material has no toughness."""
    @property
    def blade_torque(self) -> npt.NDArray[Any]:
        """(3,), N m, of the same about the origin of the blade's frame."""
    @property
    def contact(self) -> SurfaceContact:
        """SurfaceContact at rest."""
    @property
    def contact_radius(self) -> float:
        """m."""
    @property
    def nodes(self) -> int:
        """Number of nodes."""
    @property
    def converged(self) -> bool:
        """Whether the contact was found."""
    @property
    def residual(self) -> float:
        """Largest unbalanced force over the largest force."""
    @property
    def seconds(self) -> float:
        """Wall clock of the step, s."""
    @property
    def forces(self) -> dict[str, Any]:
        """dict: the row of forces.csv, by its columns."""
    @property
    def cut(self) -> Optional[dict[str, Any]]:
        """dict: the row of cuts.csv, by its columns (volumes_m3 is an array); None without cuts."""
    @property
    def tear(self) -> Optional[list[Any]]:
        """List of dicts: the rows of tears.csv, by its columns; None without tearing."""

class Session:
    """A run of a scenario, step by step. One thread works with it at a time; others wait."""
    def __init__(self, scenario: Scenario, say: Any = None, leader: str = 'path') -> None:
        """Builds and checks organ, motion and nodes. say: function of a line that it has to say. leader: 'path', the
        scenario's, or 'device', when the tool goes where it likes.
        """
    @property
    def scenario(self) -> Scenario:
        """Scenario (a copy)."""
    @property
    def steps(self) -> list[Step]:
        """List of Step: the scenario's own way."""
    @property
    def touches(self) -> bool:
        """Whether its tool touches the organ."""
    @property
    def cuts(self) -> bool:
        """Whether there is a blade or a precut, or tissue that tears."""
    @property
    def tears(self) -> bool:
        """Whether its tissue tears."""
    def prepare(self, step: Step) -> None:
        """Builds the body before the first touch, so that the first step in contact need not."""
    def step(self, step: Step) -> StepResult:
        """Goes on to a step, one of steps or another that is later than the last: cuts, moves the tool, solves, tears.
        A cut that is refused leaves everything as it was, and says why in the result.
        """
    def require_tissue(self, result: StepResult) -> None:
        """Raises NumericalError where the step found what no tissue does; a run ends there."""
    def lift_blade(self) -> None:
        """The next step with a blade only places it."""
    def coarsen(self, factor: float) -> None:
        """Spacings factor times the scenario's from the next sprinkling on."""
    def set_grip(self, closed: Optional[bool]) -> None:
        """Whether a grasper is closed from the next step on; None: by the times of the scenario."""
    def set_force_only(self, on: bool) -> None:
        """On: steps leave out what only output needs: node_values(), the residual, the opening volume."""
    def set_following_aside(self, on: bool) -> None:
        """On: nodes that follow the tool, or a cut that was put off, are made in the background."""
    def set_tear_gradually(self, on: bool) -> None:
        """On: a tear makes one increment a step at most."""
    def set_going_on(self, on: bool) -> None:
        """On: the last of steps is not the end."""
    @property
    def nodes(self) -> Nodes:
        """Nodes of the body now (a copy)."""
    @property
    def domain(self) -> Domain:
        """Domain: the organ at rest."""
    @property
    def incision(self) -> Incision:
        """Incision that the body follows now, or None."""
    @property
    def wound(self) -> Wound:
        """Wound at rest (a copy), or None in a scenario without cuts."""
    @property
    def fine_spacing(self) -> float:
        """m, of the nodes where they are fine."""
    def at(self, points: npt.ArrayLike) -> PointValues:
        """PointValues in the last step at points, (n, 3), m, of the organ at rest."""
    def node_values(self) -> PointValues:
        """PointValues of the last step at the nodes."""
    def surface(self) -> dict[str, Any]:
        """Surface of the last step as frames have it, the wound's where there are cuts: dict of points (n, 3), m,
        moved; triangles (m, 3); displacement (n, 3), m; von_mises (n,), Pa; with cuts part, piece, sheet (m,).
        """
    def front_states(self, spacing: Optional[float] = None, toughness: Any = None) -> list[FrontState]:
        """List of FrontState along the front of the cut in the last step, about spacing m apart; None: the fine
        spacing of the nodes. toughness: as front_states(); None: the scenario's, or 1 J/m2 where it has none.
        """
    @property
    def warnings(self) -> list[str]:
        """Said once each."""
    @property
    def profile(self) -> dict[str, Any]:
        """dict: wall clock of each stage, s, summed."""

class Results:
    """The folder that a run on the command line writes: tables, frames, figures, summary.json."""
    def __init__(self, folder: Union[str, PathLike[str]], session: Session) -> None:
        """The folder must not hold results yet."""
    def add(self, session: Session, result: StepResult) -> None:
        """Rows and frame of the step that the session has just done."""
    def finish(self, session: Session, status: str = 'complete', message: str = '') -> list[str]:
        """Figures and summary.json; returns the names of the files. status: 'complete', 'interrupted' or 'failed'."""

__version__: str
