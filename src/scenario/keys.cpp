#include "src/scenario/keys.hpp"

#include <array>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::app {
namespace {

using enum KeyKind;

constexpr KeyRange from(double lower, double upper = unbounded) {
  return {.lower = lower, .upper = upper, .lower_open = false, .upper_open = false};
}

// Every number has both bounds, none of them beyond what the work that hangs on it can bear: lengths that nothing in an
// organ is shorter than, times that no run ends before or lasts.
constexpr double tiny = 1e-6, instant = 1e-6, eternity = 1e6; // m, s, s
constexpr KeyRange anywhere = from(-1e6, 1e6);

constexpr std::array keys = {
    ScenarioKey{"title", text, "", "\"\"", "Name of the scenario, shown in figures and summary."},

    ScenarioKey{"organ", table, "", "required", "The body at rest."},
    ScenarioKey{"organ.shape",
                choice,
                "",
                "required",
                "Built-in shape, or a surface from a file. Block, cylinder and hemisphere stand on z = 0 about the z "
                "axis; the liver has its dome at +z, the origin at the centre of its bounding box.",
                {},
                "block, cylinder, hemisphere, liver, file"},
    ScenarioKey{"organ.size", vector, "m", "required", "Side lengths along x, y, z.", from(tiny, 10), "",
                "shape = block"},
    ScenarioKey{"organ.radius", number, "m", "required", "Radius.", from(tiny, 10), "", "shape = cylinder, hemisphere"},
    ScenarioKey{"organ.height", number, "m", "required", "Height.", from(tiny, 10), "", "shape = cylinder"},
    ScenarioKey{"organ.edge", number, "m", "", "Edge length of the surface mesh; left out: 1/40 of the largest size.",
                from(tiny, 1), "", "shape = block, cylinder, hemisphere"},
    ScenarioKey{"organ.triangles", integer, "", "20000", "Triangles of the surface, about.", from(1000, 500000), "",
                "shape = liver"},
    ScenarioKey{"organ.file",
                text,
                "",
                "required",
                "OBJ, PLY, STL, OFF, legacy VTK or VTP file of a closed surface, or a label volume (NRRD, NIfTI or "
                "MetaImage: .nrrd, .nii, .nii.gz, .mha), relative to the scenario file.",
                {},
                "",
                "shape = file"},
    ScenarioKey{"organ.scale", number, "", "",
                "Metres per unit of the file (0.001 for millimetres); left out: 1, for a label volume the unit of its "
                "header, millimetres where that names none.",
                from(1e-9, 1e6), "", "shape = file"},
    ScenarioKey{"organ.label", integer, "", "",
                "Value of the voxels of a label volume that are the organ; left out: its only one but 0.",
                from(-32768, 65535), "", "shape = file"},
    ScenarioKey{
        "organ.pieces",
        choice,
        "",
        "\"refuse\"",
        "A surface in several pieces that hang together nowhere: an error, the one of the largest volume alone, or "
        "all of them, each of which has to be held by a fixed region.",
        {},
        "refuse, largest, all",
        "shape = file"},
    ScenarioKey{
        "organ.cavities",
        choice,
        "",
        "\"keep\"",
        "Closed cavities within the organ (a bladder, a ventricle, a cyst): they stay empty, they are filled with "
        "tissue, or they are an error.",
        {},
        "keep, fill, refuse",
        "shape = file"},
    ScenarioKey{"organ.voxel_size", number, "m", "", "Voxel of the level set; left out: 1/128 of the largest extent.",
                from(2e-5, 1), "", "shape = liver, file"},

    ScenarioKey{"material", table, "", "required",
                "What the organ is made of (docs/theory.md): one law, and regions with a stiffness of their own."},
    ScenarioKey{
        "material.law",
        choice,
        "",
        "\"linear\"",
        "Law of the material: small strain, or one of finite strain. check tells its moduli; run computes all of "
        "them.",
        {},
        "linear, neo_hookean, yeoh, ogden, holzapfel_gasser_ogden"},
    ScenarioKey{"material.young_modulus", number, "Pa", "required",
                "Young's modulus E, of a law with fibres that of the matter between them. Liver: about 5e3 to 1e4.",
                from(1e-3, 1e12), "", "law = linear, neo_hookean, holzapfel_gasser_ogden"},
    ScenarioKey{"material.poisson_ratio", number, "", "required",
                "Poisson's ratio nu. Soft tissue: 0.45 to 0.49. Above 0.49 method galerkin is too stiff (told); 0.5 "
                "(incompressible) cannot be "
                "computed.",
                from(0, 0.499)},
    ScenarioKey{"material.c1", number, "Pa", "required", "Half the shear modulus: c1 (I1 - 3) in the energy.",
                from(1e-3, 1e12), "", "law = yeoh"},
    ScenarioKey{"material.c2", number, "Pa", "0.0", "Of (I1 - 3)^2 in the energy.", from(-1e12, 1e12), "",
                "law = yeoh"},
    ScenarioKey{"material.c3", number, "Pa", "0.0", "Of (I1 - 3)^3 in the energy.", from(-1e12, 1e12), "",
                "law = yeoh"},
    ScenarioKey{"material.fibre_modulus", number, "Pa", "required",
                "Modulus k1 of the fibres: in small tension each family adds 4 k1 along itself.", from(1e-3, 1e12), "",
                "law = holzapfel_gasser_ogden"},
    ScenarioKey{"material.fibre_exponent", number, "", "required",
                "Exponent k2 of the fibres: how fast they stiffen. Artery, skin: 0.5 to 100.", from(1e-6, 1e4), "",
                "law = holzapfel_gasser_ogden"},
    ScenarioKey{"material.fibre_dispersion", number, "", "0.0",
                "Spread of a family's directions: 0, all alike; 1/3, none preferred.", from(0, 1.0 / 3), "",
                "law = holzapfel_gasser_ogden"},
    ScenarioKey{"material.density", number, "kg/m3", "1060.0", "Mass density, used by gravity alone.", from(1e-3, 1e5)},
    ScenarioKey{"material.toughness", number, "J/m2", "",
                "Energy that new cut takes, G_c: the blade deforms the tissue until that energy is there, and feels a "
                "force. Liver: 76 to 225. Left out: the blade cuts whatever its edge sweeps, without resistance. With "
                "[tearing] also the energy at which a cut runs on by itself.",
                from(1e-6, 1e6)},
    ScenarioKey{
        "material.ogden",
        array_of_tables,
        "",
        "required",
        "Terms of Ogden's law, one to three: modulus / exponent (l1^exponent + l2^exponent + l3^exponent - 3) in "
        "the energy, l the stretches without change of volume.",
        {},
        "",
        "law = ogden"},
    ScenarioKey{"material.ogden[].modulus", number, "Pa", "required",
                "Modulus; the sum of modulus times exponent is twice the shear modulus.", from(-1e12, 1e12)},
    ScenarioKey{"material.ogden[].exponent", number, "", "required", "Exponent, not 0.", from(-50, 50)},
    ScenarioKey{"material.fibre",
                array_of_tables,
                "",
                "required",
                "Families of fibres, one or two.",
                {},
                "",
                "law = holzapfel_gasser_ogden"},
    ScenarioKey{"material.fibre[].course",
                choice,
                "",
                "\"straight\"",
                "How the family runs: alike everywhere, or away from a line or a point.",
                {},
                "straight, radial"},
    ScenarioKey{"material.fibre[].direction", vector, "", "required",
                "Direction of the family in the organ as it is given, any length.", anywhere, "", "course = straight"},
    ScenarioKey{"material.fibre[].centre", vector, "m", "required", "Point that it runs away from.", anywhere, "",
                "course = radial"},
    ScenarioKey{
        "material.fibre[].axis", vector, "", "",
        "Direction of a line through that point, any length: it runs away from the line. Left out: from the point.",
        anywhere, "", "course = radial"},
    ScenarioKey{
        "material.prony", array_of_tables, "", "",
        "Viscoelasticity beside any law, up to three terms: under held strain the part of the stress that changes "
        "shape fades. The constants of the law are those of a sudden strain. Left out: none fades."},
    ScenarioKey{"material.prony[].share", number, "", "required",
                "Share of that stress that fades; all shares add to less than 1.", from(1e-6, 1)},
    ScenarioKey{"material.prony[].time", number, "s", "required", "Time in which it fades to 1 / e of itself.",
                from(instant, eternity)},
    ScenarioKey{"material.layer", array_of_tables, "", "",
                "Parts of the tissue with a toughness of their own, for tearing: layers, a weak plane. Where several "
                "hold a place the last one counts. Left out: none."},
    ScenarioKey{"material.layer[].region", choice, "", "required", "Kind of region.", {}, "box, slab"},
    ScenarioKey{"material.layer[].toughness", number, "J/m2", "required", "Energy that new tear takes there.",
                from(1e-6, 1e6)},
    ScenarioKey{"material.layer[].lower", vector, "m", "required", "Corner of smallest coordinates.", anywhere, "",
                "region = box"},
    ScenarioKey{"material.layer[].upper", vector, "m", "required", "Corner of largest coordinates.", anywhere, "",
                "region = box"},
    ScenarioKey{"material.layer[].point", vector, "m", "required", "Point of its middle plane.", anywhere, "",
                "region = slab"},
    ScenarioKey{"material.layer[].normal", vector, "", "required", "Normal of its middle plane, any length.", anywhere,
                "", "region = slab"},
    ScenarioKey{"material.layer[].thickness", number, "m", "required", "Thickness.", from(tiny, 10), "",
                "region = slab"},
    ScenarioKey{
        "material.region", array_of_tables, "", "",
        "Parts of the tissue with a stiffness of their own: layers, a capsule, a nodule, a vessel wall. They may "
        "share faces and must not overlap. With material.law = linear and method galerkin, without cuts. Left "
        "out: none."},
    ScenarioKey{"material.region[].name", text, "", "\"\"", "Name for messages; left out: the number of the region."},
    ScenarioKey{"material.region[].shape",
                choice,
                "",
                "required",
                "Shape of the region; depth: a layer below the organ's surface; file: inside a closed surface.",
                {},
                "box, slab, sphere, half_space, depth, file"},
    ScenarioKey{"material.region[].young_modulus", number, "Pa", "required", "Young's modulus E there.",
                from(1e-3, 1e12)},
    ScenarioKey{"material.region[].poisson_ratio", number, "", "required", "Poisson's ratio nu there.", from(0, 0.499)},
    ScenarioKey{"material.region[].density", number, "kg/m3", "", "Mass density there; left out: material.density.",
                from(1e-3, 1e5)},
    ScenarioKey{"material.region[].lower", vector, "m", "required", "Corner of smallest coordinates.", anywhere, "",
                "shape = box"},
    ScenarioKey{"material.region[].upper", vector, "m", "required", "Corner of largest coordinates.", anywhere, "",
                "shape = box"},
    ScenarioKey{"material.region[].point", vector, "m", "required",
                "Point of its middle plane, of a half-space of its bounding plane.", anywhere, "",
                "shape = slab, half_space"},
    ScenarioKey{"material.region[].normal", vector, "", "required",
                "Normal of that plane, any length; of a half-space pointing out of the region.", anywhere, "",
                "shape = slab, half_space"},
    ScenarioKey{"material.region[].thickness", number, "m", "required", "Thickness.", from(tiny, 10), "",
                "shape = slab"},
    ScenarioKey{"material.region[].centre", vector, "m", "required", "Centre.", anywhere, "", "shape = sphere"},
    ScenarioKey{"material.region[].radius", number, "m", "required", "Radius.", from(tiny, 10), "", "shape = sphere"},
    ScenarioKey{"material.region[].from", number, "m", "0.0", "Depth below the surface at which it begins.",
                from(0, 10), "", "shape = depth"},
    ScenarioKey{"material.region[].to", number, "m", "required", "Depth below the surface at which it ends.",
                from(tiny, 10), "", "shape = depth"},
    ScenarioKey{"material.region[].file",
                text,
                "",
                "required",
                "Closed surface or label volume, beside the scenario, in the organ's coordinates: the formats of "
                "organ.file.",
                {},
                "",
                "shape = file"},
    ScenarioKey{"material.region[].scale", number, "", "",
                "Metres per unit of the file; left out: 1, of a label volume as organ.scale.", from(1e-9, 1e6), "",
                "shape = file"},
    ScenarioKey{"material.region[].label", integer, "", "",
                "Value of the voxels of a label volume that are the region; left out: its only one but 0.",
                from(-32768, 65535), "", "shape = file"},
    ScenarioKey{
        "material.pretension", strain, "", "[0, 0, 0]",
        "Strain by which the tissue is stretched in its given shape, so that a cut gapes: xx, yy, zz, and, when "
        "six are given, the tensor components yz, xz, xy. 0.05 along x: 5 % longer than without stress.",
        from(-0.5, 0.5)},

    ScenarioKey{"fixed", array_of_tables, "", "required",
                "Regions that hold the organ: every surface node inside one is fixed. At least one region."},
    ScenarioKey{"fixed[].name", text, "", "\"\"", "Name for messages; left out: the number of the region."},
    ScenarioKey{"fixed[].region", choice, "", "required", "Kind of region.", {}, "box, sphere, half_space"},
    ScenarioKey{"fixed[].lower", vector, "m", "required", "Corner of smallest coordinates.", anywhere, "",
                "region = box"},
    ScenarioKey{"fixed[].upper", vector, "m", "required", "Corner of largest coordinates.", anywhere, "",
                "region = box"},
    ScenarioKey{"fixed[].centre", vector, "m", "required", "Centre.", anywhere, "", "region = sphere"},
    ScenarioKey{"fixed[].radius", number, "m", "required", "Radius.", from(tiny, 1e6), "", "region = sphere"},
    ScenarioKey{"fixed[].point", vector, "m", "required", "Point of the bounding plane.", anywhere, "",
                "region = half_space"},
    ScenarioKey{"fixed[].normal", vector, "", "required",
                "Normal of the bounding plane, any length, pointing out of the region.", anywhere, "",
                "region = half_space"},
    ScenarioKey{"fixed[].axes", axes, "", "[\"x\", \"y\", \"z\"]",
                "Components of the displacement that are held; each axis in one region at least."},

    ScenarioKey{"nodes", table, "", "", "Sprinkling of the organ with nodes; left out: all defaults."},
    ScenarioKey{
        "nodes.fine_spacing", number, "m", "",
        "Node spacing at the contact, the fronts of the cuts and along the blade's way; left out: tip radius / 3, or "
        "cut.front_spacing without a tool.",
        from(tiny, 1)},
    ScenarioKey{"nodes.coarse_spacing", number, "m", "",
                "Largest node spacing, far from contact and cuts; left out: 1/10 of the largest extent, at least fine, "
                "and half the "
                "thickness of thin walls as far as 8000 nodes go.",
                from(tiny, 1)},
    ScenarioKey{"nodes.slope", number, "", "0.3", "Growth of the spacing per distance from the fine zone.",
                from(1e-3, 1)},
    ScenarioKey{"nodes.fine_radius", number, "m", "",
                "Radius of the fine zone about the contact; left out: 1.5 tip radii.", from(tiny, 10)},
    ScenarioKey{"nodes.count", integer, "", "",
                "Number of nodes, about: both spacings are scaled by one factor to reach it; left out: not scaled.",
                from(20, 200000)},
    ScenarioKey{"nodes.random_seed", integer, "", "1", "Seed of the sprinkling; the same seed gives the same bits.",
                from(0, 9e15)},

    ScenarioKey{"method", table, "", "", "Discretisation; left out: all defaults."},
    ScenarioKey{"method.name",
                choice,
                "",
                "\"galerkin\"",
                "Weak form, force balance of each node's cell, or the scheme of the paper as published (it does not "
                "converge and its force is not a true one: for comparison).",
                {},
                "galerkin, collocation, published"},
    ScenarioKey{
        "method.support_radius", number, "", "",
        "Radius of a sphere of influence in units of the local spacing (galerkin below a Poisson ratio of 0.45: less "
        "where the sphere would reach into finer nodes); left out: collocation 1.8, galerkin 2.2 from that ratio on, "
        "below it 1.75 where a precut or a blade cuts the body and 2 elsewhere.",
        from(1.2, 4)},
    ScenarioKey{"method.quadrature", integer, "", "2",
                "Rule of a background cell (galerkin): 1, its centre; 2, six points, exact to degree three; 3, 27 "
                "Gauss points.",
                from(1, 3)},

    ScenarioKey{"gravity", table, "", "", "Weight of the organ; left out: none. The given shape is the unloaded one."},
    ScenarioKey{"gravity.acceleration", vector, "m/s2", "required", "Acceleration, e.g. [0, 0, -9.81].",
                from(-100, 100)},

    ScenarioKey{"tool", table, "", "",
                "The rigid tool and its way; left out: none, then there is a blade, a precut, gravity or pretension."},
    ScenarioKey{
        "tool.shape",
        choice,
        "",
        "required",
        "Ball, flat cylindrical punch, instrument (shaft and ball) that pivots on a port, or grasper: takes hold "
        "of the surface within its radius and moves it as it moves itself.",
        {},
        "sphere_tip, flat_punch, laparoscope, grasper"},
    ScenarioKey{"tool.radius", number, "m", "required", "Radius of the ball, of the flat end or of the grasped patch.",
                from(tiny, 1), "", "shape = sphere_tip, flat_punch, grasper"},
    ScenarioKey{"tool.grasp", number, "s", "",
                "Time at which it takes hold: the tool is then within its radius of the surface. Left out: the start "
                "of its path.",
                from(0, eternity), "", "shape = grasper"},
    ScenarioKey{"tool.release", number, "s", "", "Time at which it lets go; left out: never.", from(0, eternity), "",
                "shape = grasper"},
    ScenarioKey{"tool.length", number, "m", "0.05", "Length of the punch.", from(tiny, 10), "", "shape = flat_punch"},
    ScenarioKey{"tool.tip_radius", number, "m", "0.004", "Radius of the tip.", from(tiny, 1), "",
                "shape = laparoscope"},
    ScenarioKey{"tool.shaft_radius", number, "m", "0.0025", "Radius of the shaft, at most the tip's.", from(tiny, 1),
                "", "shape = laparoscope"},
    ScenarioKey{"tool.shaft_length", number, "m", "0.3", "Length of the shaft from the tip centre backwards.",
                from(tiny, 10), "", "shape = laparoscope"},
    ScenarioKey{"tool.port", vector, "m", "required", "Point of the abdominal wall that the shaft pivots on.", anywhere,
                "", "shape = laparoscope"},
    ScenarioKey{"tool.axis", vector, "", "[0, 0, 1]", "Direction from the tip into the tool, away from the organ.",
                anywhere, "", "shape = sphere_tip, flat_punch, grasper"},
    ScenarioKey{"tool.step", number, "s", "",
                "Time step; left out: 1/20 of the duration. Every pose of a path is a step, too.",
                from(1e-7, eternity)},
    ScenarioKey{"tool.approach", table, "", "",
                "A straight press: the tool starts outside, touches, and goes on to a depth. This or path."},
    ScenarioKey{"tool.approach.target", vector, "m", "required", "Point that the line of motion runs through.",
                anywhere},
    ScenarioKey{"tool.approach.direction", vector, "", "required", "Direction of motion, any length.", anywhere},
    ScenarioKey{"tool.approach.depth", number, "m", "required",
                "Way of the tool after its first touch of the organ as gravity, pressure and pretension hold it.",
                from(tiny, 1)},
    ScenarioKey{"tool.approach.clearance", number, "m", "0.002", "Way of the tool before that touch.", from(tiny, 1)},
    ScenarioKey{"tool.approach.duration", number, "s", "1.0", "Duration of the whole motion.", from(instant, eternity)},
    ScenarioKey{"tool.path", array_of_tables, "", "",
                "Poses of the tool, joined by straight lines; at least two. This or approach."},
    ScenarioKey{"tool.path[].time", number, "s", "required", "Time, rising from pose to pose.", from(0, eternity)},
    ScenarioKey{"tool.path[].position", vector, "m", "required", "The tool's reference point: the end of its tip.",
                anywhere},

    ScenarioKey{"contact", table, "", "", "How tool and organ touch; left out: all defaults."},
    ScenarioKey{
        "contact.condition",
        choice,
        "",
        "\"frictionless\"",
        "Frictionless: the tool slides freely. Frictional: what is touched sticks to the tool until Coulomb's limit "
        "is reached, and slips at it. Bonded: what has been touched moves with the tool.",
        {},
        "frictionless, frictional, bonded"},
    ScenarioKey{"contact.friction", number, "", "0.3",
                "Coefficient of friction between tool and tissue. Wet organs: 0.05 to 0.3; a dry glove: up to 1.",
                from(0, 2), "", "condition = frictional"},
    ScenarioKey{"contact.candidate_radius", number, "m", "",
                "Surface nodes so near to the first contact may touch the tool; left out: fine radius + 2 fine "
                "spacings. Grows by itself when the tool reaches farther.",
                from(tiny, 10)},
    ScenarioKey{"contact.follow_fraction", number, "", "0.5",
                "The fine zone follows when the contact has left its centre by this fraction of the fine radius.",
                from(1e-3, 1)},

    ScenarioKey{"precut", array_of_tables, "", "",
                "Cuts that are there from the start, as many as needed: sheets without thickness, inside the organ or "
                "reaching out of it. They may cross one another, not lie on one another. Left out: none."},
    ScenarioKey{"precut[].shape", choice, "", "required", "Kind of sheet.", {}, "disc, rectangle, polygon, file"},
    ScenarioKey{"precut[].centre", vector, "m", "required", "Centre.", anywhere, "", "shape = disc, rectangle"},
    ScenarioKey{"precut[].normal", vector, "", "required", "Normal of the sheet, any length.", anywhere, "",
                "shape = disc, rectangle"},
    ScenarioKey{"precut[].radius", number, "m", "required", "Radius.", from(tiny, 10), "", "shape = disc"},
    ScenarioKey{"precut[].up", vector, "", "required",
                "Direction of the height, any length; its part along the normal is ignored.", anywhere, "",
                "shape = rectangle"},
    ScenarioKey{"precut[].width", number, "m", "required", "Size across up.", from(tiny, 10), "", "shape = rectangle"},
    ScenarioKey{"precut[].height", number, "m", "required", "Size along up.", from(tiny, 10), "", "shape = rectangle"},
    ScenarioKey{"precut[].points", points, "m", "required",
                "Corners of a plane polygon, in order around it; three or more.", anywhere, "", "shape = polygon"},
    ScenarioKey{"precut[].file",
                text,
                "",
                "required",
                "OBJ, PLY, STL, OFF, legacy VTK or VTP file of a surface, open or closed, relative to the scenario "
                "file.",
                {},
                "",
                "shape = file"},
    ScenarioKey{"precut[].scale", number, "", "1", "Metres per unit of the file (0.001 for millimetres).",
                from(1e-9, 1e6), "", "shape = file"},
    ScenarioKey{"precut[].pressure", number, "Pa", "0.0", "Pressure on both faces; positive pushes them apart.",
                from(-1e9, 1e9)},

    ScenarioKey{"cut", table, "", "", "How cuts are computed; left out: all defaults."},
    ScenarioKey{
        "cut.sight",
        choice,
        "",
        "",
        "How a sphere reaches around a cut: it ends where the cut hides its node, it bends around the front, it "
        "bends and the basis gains the field of a crack front, or it stays what it is and the cut appends functions "
        "(method galerkin). Left out: the last for cuts at finite strain that do not tear, else the method's own.",
        {},
        "visibility, diffraction, enriched, appended"},
    ScenarioKey{"cut.lips",
                choice,
                "",
                "\"frictionless\"",
                "Contact between the faces of a cut: none (they may go through one another), sliding, or sticking.",
                {},
                "open, frictionless, sticking"},
    ScenarioKey{
        "cut.unheld",
        choice,
        "",
        "\"hold\"",
        "A severed piece that no fixed region holds: the cut is refused, soft springs hold the piece, or it leaves the "
        "computation. With a law other than linear it is refused whatever stands here: a fixed region must hold it.",
        {},
        "refuse, hold, drop"},
    ScenarioKey{
        "cut.front_spacing", number, "m", "",
        "Node spacing at the fronts of the cuts (a precut that parts the organ has none) and along the way of the "
        "blade, where it is finer than nodes.fine_spacing; left out: that, or without it and without a tool 0.15 "
        "of how far a precut reaches behind its front (a disc's radius, the depth of a cut from the surface), as far "
        "as 8000 nodes go, and at most a sixth of the root of its area; for a blade a twelfth of its edge.",
        from(tiny, 1)},

    ScenarioKey{"blade", table, "", "", "A blade that cuts along its way; left out: none."},
    ScenarioKey{"blade.edge", points, "m", "required",
                "Cutting edge in the blade's own frame, from end to end; two points or more.", from(-10, 10)},
    ScenarioKey{"blade.edge_radius", number, "m", "0.0001", "Radius of the cutting edge.", from(1e-7, 0.01)},
    ScenarioKey{"blade.sharpness", number, "", "1.0",
                "Share of the edge's work that makes new surface; the rest is lost beside the cut. 1: ideally sharp. "
                "Needs material.toughness.",
                from(1e-3, 1)},
    ScenarioKey{"blade.friction", number, "Pa", "0.0",
                "Shear by which the flanks of the blade drag the faces of the cut. Needs material.toughness and "
                "blade.flank.",
                from(0, 1e7)},
    ScenarioKey{"blade.flank", number, "m", "0.0", "How far behind the edge the flanks touch the faces of the cut.",
                from(0, 1)},
    ScenarioKey{"blade.step", number, "s", "",
                "Time step; left out: such that the edge moves by about one spacing of the front in a step.",
                from(1e-7, eternity)},
    ScenarioKey{
        "blade.advance", number, "", "",
        "Fine spacings that the edge goes before wound and body follow its cut; 0: they do in every step. What is "
        "put off is cut by the way that the edge took, at the latest when it leaves the body or the run ends. "
        "It tells where steps are shorter than that: in real time, or with a small blade.step. Left out: 0.5 in real "
        "time, where the body then follows in the background, and 0 elsewhere. Above 0 not with material.toughness, "
        "which in real time lets the blade cut in the background as well where this is "
        "left out.",
        from(0, 1)},
    ScenarioKey{"blade.path", array_of_tables, "", "required",
                "Poses of the blade, between which it moves evenly; at least two. It cuts whatever its edge sweeps."},
    ScenarioKey{"blade.path[].time", number, "s", "required", "Time, rising from pose to pose.", from(0, eternity)},
    ScenarioKey{"blade.path[].position", vector, "m", "required", "Origin of the blade's frame.", anywhere},
    ScenarioKey{
        "blade.path[].rotation", vector, "degrees", "[0, 0, 0]",
        "Turn of the blade's frame: about the axis along this vector, by its length. [0, 0, 90]: a quarter turn "
        "about z. From one pose to the next about one axis it turns by the difference, however far; else by the "
        "shorter way.",
        from(-360, 360)},

    ScenarioKey{"tearing", table, "", "",
                "Cuts that run on by themselves where the energy they release reaches material.toughness "
                "(docs/tearing.md). Left out: none does."},
    ScenarioKey{"tearing.enabled", boolean, "", "true", "False: as if the table were left out."},
    ScenarioKey{"tearing.step", number, "", "0.5",
                "Longest way of the front in one increment, in node spacings at the front.", from(0.1, 2)},
    ScenarioKey{"tearing.direction",
                choice,
                "",
                "\"weakest\"",
                "Where a front turns to: largest release by hoop stress over the toughness that it meets there, or "
                "largest hoop stress alone. The same where the toughness is uniform.",
                {},
                "weakest, hoop_stress"},
    ScenarioKey{"tearing.strength", number, "Pa", "",
                "Largest principal stress, averaged over tearing.length, at which a tear starts where there is no cut. "
                "Left out: tears start at cuts alone.",
                from(1e-3, 1e12)},
    ScenarioKey{
        "tearing.length", number, "m", "",
        "Radius of the ball over which that stress is averaged; left out: 2 E G_c / (pi (1 - nu^2) strength^2).",
        from(tiny, 1)},
    ScenarioKey{"tearing.most_increments", integer, "", "40",
                "Increments of the tears in one step of the run; what is left over goes on in the next.",
                from(1, 10000)},
    ScenarioKey{"tearing.most_area", number, "m2", "",
                "Nothing tears any more beyond this torn area; left out: no limit.", from(1e-12, 100)},

    ScenarioKey{"haptics", table, "", "",
                "The force loop of `spherecut haptics`; left out: all defaults. Other commands do not read it."},
    ScenarioKey{"haptics.rate", number, "1/s", "1000.0", "Ticks of the haptic loop per second.", from(50, 10000)},
    ScenarioKey{"haptics.model",
                choice,
                "",
                "\"tangent\"",
                "Force between solves: the condensed contact with the tool where it is, the line through the last two "
                "solves, or the last solve.",
                {},
                "tangent, linear_in_time, hold"},
    ScenarioKey{"haptics.hand_over", number, "s", "0.02",
                "Time in which the difference between the old and the new force fades at a solve.", from(0, 1)},
    ScenarioKey{"haptics.budget", number, "s", "0.01",
                "Time that a rebuild of the nodes should take; missing it coarsens the next (docs/haptics.md).",
                from(instant, 100)},
    ScenarioKey{"haptics.passivity", boolean, "", "true", "Damp what the loop would otherwise give to the hand."},
    ScenarioKey{"haptics.viewer_rate", number, "1/s", "60.0", "Most frames per second for a viewer; 0: none.",
                from(0, 1000)},
    ScenarioKey{
        "haptics.device",
        choice,
        "",
        "\"hand\"",
        "What moves on the path of the tool (without a tool, of the blade): a simulated hand that gives way to "
        "the force, or the path itself; or whatever moved in a recorded session; or real hardware behind a socket "
        "(docs/haptic_bridge.md); or an Inverse3 behind its maker's service (docs/devices.md).",
        {},
        "hand, script, recording, bridge, haply"},
    ScenarioKey{"haptics.recording",
                text,
                "",
                "",
                "The recording that moves the device, a haptic.recording; beside the scenario unless absolute.",
                {},
                {},
                "device = recording"},
    ScenarioKey{"haptics.bridge", table, "", "",
                "Where a client with real hardware finds the loop; left out: all defaults."},
    ScenarioKey{"haptics.bridge.address", text, "", "\"127.0.0.1\"",
                "Of this machine, IPv4. Other machines reach it only at another address than the default; nothing is "
                "encrypted."},
    ScenarioKey{"haptics.bridge.port", integer, "", "27510", "UDP port; 0: one that is free, which is said.",
                from(0, 65535)},
    ScenarioKey{"haptics.bridge.timeout", number, "s", "0.1",
                "Without a pose for so long, a client has gone: the force goes to zero and the next may come.",
                from(0.005, 10)},
    ScenarioKey{"haptics.haply", table, "", "", "Where the service of an Inverse3 is found; left out: all defaults."},
    ScenarioKey{"haptics.haply.address", text, "", "\"ws://localhost:10001\"",
                "Of the service: ws://HOST:PORT. Nothing is encrypted."},
    ScenarioKey{"haptics.haply.device_id", text, "", "\"\"",
                "Of the Inverse3, as the service names it; empty: the first that it has."},
    ScenarioKey{"haptics.haply.timeout", number, "s", "0.1",
                "Without a pose for so long, the device has gone: the force goes to zero until it is back.",
                from(0.005, 10)},
    ScenarioKey{"haptics.second", table, "", "",
                "The device of a second hand, which holds the blade beside the tool in the first; limits and model are "
                "those of the first. Left out: one hand, beside which a blade keeps to its path."},
    ScenarioKey{"haptics.second.device",
                choice,
                "",
                "\"hand\"",
                "As haptics.device, on the path of the blade. A haptics.recording of two hands moves both.",
                {},
                "hand, script, bridge, haply"},
    ScenarioKey{"haptics.second.bridge", table, "", "", "As haptics.bridge, for the second hand's client."},
    ScenarioKey{"haptics.second.bridge.address", text, "", "\"127.0.0.1\"", "Of this machine, IPv4."},
    ScenarioKey{"haptics.second.bridge.port", integer, "", "27511", "UDP port; 0: one that is free, which is said.",
                from(0, 65535)},
    ScenarioKey{"haptics.second.bridge.timeout", number, "s", "0.1", "As haptics.bridge.timeout.", from(0.005, 10)},
    ScenarioKey{"haptics.second.haply", table, "", "", "As haptics.haply, for the second hand's Inverse3."},
    ScenarioKey{"haptics.second.haply.address", text, "", "\"ws://localhost:10001\"", "Of the service."},
    ScenarioKey{"haptics.second.haply.device_id", text, "", "\"\"",
                "Of the Inverse3; with one in each hand it has to be there."},
    ScenarioKey{"haptics.second.haply.timeout", number, "s", "0.1", "As haptics.haply.timeout.", from(0.005, 10)},
    ScenarioKey{"haptics.limits", table, "", "", "What the device can take; left out: a small desktop device."},
    ScenarioKey{"haptics.limits.gain", number, "", "1.0", "Force on the hand per force of the tissue.", from(0, 1000)},
    ScenarioKey{"haptics.limits.force", number, "N", "3.3", "Largest force.", from(1e-3, 1000)},
    ScenarioKey{"haptics.limits.slew", number, "N/s", "500.0", "Fastest change of the force.", from(1e-3, 1e6)},
    ScenarioKey{"haptics.limits.torque", number, "N m", "0.1",
                "Largest torque; the time from none to it is that of the force, force / slew.", from(0, 100)},
    ScenarioKey{"haptics.limits.stiffness", number, "N/m", "1000.0",
                "Stiffest contact that the device renders steadily; with the controller on, a stiffer one is rendered "
                "as stiff as that.",
                from(1e-3, 1e6)},
    ScenarioKey{"haptics.limits.damping", number, "N s/m", "5.0", "Most damping that the controller adds.",
                from(0, 1000)},
    ScenarioKey{"haptics.limits.resolution", number, "m", "5.5e-5", "Step of the position sensor.", from(0, 0.01)},
    ScenarioKey{"haptics.limits.delay", integer, "ticks", "0", "By which a force acts late.", from(0, 15)},
    ScenarioKey{"haptics.hand", table, "", "", "The simulated hand; left out: all defaults."},
    ScenarioKey{"haptics.hand.mass", number, "kg", "0.1", "Of hand and device.", from(1e-6, 10)},
    ScenarioKey{"haptics.hand.stiffness", number, "N/m", "300.0", "Of its spring towards the path.", from(0, 1e5)},
    ScenarioKey{"haptics.hand.damping", number, "N s/m", "5.0", "Against the path's velocity.", from(0, 1000)},

    ScenarioKey{"output", table, "", "", "What is written; left out: all defaults."},
    ScenarioKey{"output.vtp_every", integer, "", "1", "Steps between two VTP frames; 0: none.", from(0, 1e6)},
    ScenarioKey{"output.figures", boolean, "", "true", "Draw PNG figures at the end."},
};

} // namespace

bool KeyRange::holds(double value) const {
  return (lower_open ? value > lower : value >= lower) && (upper_open ? value < upper : value <= upper);
}

std::span<const ScenarioKey> scenario_keys() {
  return keys;
}

const ScenarioKey* find_scenario_key(std::string_view path) {
  for (const ScenarioKey& key : keys)
    if (key.path == path)
      return &key;
  return nullptr;
}

std::string_view table_of(std::string_view path) {
  const auto dot = path.rfind('.');
  return dot == std::string_view::npos ? std::string_view{} : path.substr(0, dot);
}

std::string_view leaf_of(std::string_view path) {
  return path.substr(path.rfind('.') + 1);
}

std::string joined_path(std::string_view table, std::string_view key) {
  return table.empty() ? std::string(key) : fmt::format("{}.{}", table, key);
}

std::string allowed_values(const ScenarioKey& key) {
  if (key.kind == choice)
    return fmt::format("one of: {}", key.choices);
  if (key.kind == axes)
    return "\"x\", \"y\", \"z\", each at most once, at least one";
  std::string text;
  if (std::isfinite(key.range.lower))
    text += fmt::format("{:g} {} ", key.range.lower, key.range.lower_open ? "<" : "<=");
  if (std::isfinite(key.range.lower) || std::isfinite(key.range.upper))
    text += key.kind == vector || key.kind == points || key.kind == strain ? "each" : "value";
  if (std::isfinite(key.range.upper))
    text += fmt::format(" {} {:g}", key.range.upper_open ? "<" : "<=", key.range.upper);
  return text;
}

} // namespace spherecut::app
