#include "python/bindings/tables.hpp"

#include "src/cut_output.hpp"

namespace spherecut::bindings {
namespace {

void put(py::dict& row, const char* key, const Vector3& value, const char* unit) {
  const char* const axes[] = {"_x", "_y", "_z"};
  for (Eigen::Index a = 0; a < 3; ++a)
    row[py::str(std::string(key) + axes[a] + unit)] = value[a];
}

void put(py::dict& row, const app::RebuildSeconds& seconds) {
  row["topology_s"] = seconds.topology;
  row["level_sets_s"] = seconds.level_sets;
  row["visibility_s"] = seconds.visibility;
  row["sprinkling_s"] = seconds.sprinkling;
  row["assembly_s"] = seconds.assembly;
  row["solve_s"] = seconds.solve;
}

} // namespace

py::dict force_row(const app::StepResult& r) {
  py::dict row;
  row["time_s"] = r.time;
  put(row, "tool", r.pose.point, "_m");
  put(row, "axis", r.pose.axis, "");
  put(row, "force", r.force, "_N");
  row["force_N"] = r.force.norm();
  put(row, "contact", r.contact.point, "_m");
  row["depth_m"] = r.contact.depth;
  row["contact_radius_m"] = r.contact_radius;
  row["active_nodes"] = r.active_nodes;
  row["candidate_nodes"] = r.candidates;
  row["nodes"] = r.nodes;
  row["iterations"] = r.iterations;
  row["converged"] = r.converged;
  row["residual"] = r.residual;
  row["penetration_m"] = r.largest_penetration;
  row["rotation_deg"] = r.rotation_degrees;
  row["resprinkled"] = r.resprinkled;
  row["force_jump"] = r.force_jump;
  row["seconds"] = r.seconds;
  const Vector3 normal = r.force - r.tangential;
  put(row, "normal", normal, "_N");
  row["normal_N"] = normal.norm();
  put(row, "tangential", r.tangential, "_N");
  row["tangential_N"] = r.tangential.norm();
  put(row, "torque", r.torque, "_Nm");
  row["torque_Nm"] = r.torque.norm();
  return row;
}

py::dict cut_row(double time, const app::CutReport& r) {
  py::dict row;
  row["time_s"] = time;
  row["triangles"] = r.triangles;
  row["refused"] = r.refused;
  row["sheets"] = r.sheets;
  row["area_m2"] = r.area;
  row["front_m"] = r.front_length;
  row["pieces"] = r.pieces;
  row["unheld"] = r.unheld;
  row["volumes_m3"] = owned(std::vector<double>(r.volumes));
  row["opening_m"] = r.opening;
  row["opening_volume_m3"] = r.opening_volume;
  row["lip_pairs"] = r.lip_pairs;
  row["closed_pairs"] = r.closed_pairs;
  row["lips_converged"] = r.lips_converged;
  row["nodes"] = r.nodes;
  row["kept_nodes"] = r.kept_nodes;
  row["surface_hash"] = app::hash_text(r.surface_hash);
  put(row, r.seconds);
  row["update"] = std::string(to_string(r.update));
  row["update_reason"] = r.update_reason;
  put(row, "blade_force", r.blade.force, "_N");
  row["edge_force_N"] = r.blade.edge_force;
  row["advance_m"] = r.blade.advance;
  row["release_J_m2"] = r.blade.release;
  row["work_J"] = r.blade.ledger.work;
  row["surface_J"] = r.blade.ledger.surface;
  row["crushing_J"] = r.blade.ledger.crushing;
  row["friction_J"] = r.blade.ledger.friction;
  row["excess_J"] = r.blade.ledger.excess;
  row["stored_J"] = r.blade.ledger.stored;
  row["reason"] = r.reason;
  put(row, "blade_torque", r.blade.torque, "_Nm");
  return row;
}

py::list tear_rows(const app::TearReport& report) {
  py::list rows;
  for (std::size_t k = 0; k < report.increments.size(); ++k) {
    const app::TearIncrement& r = report.increments[k];
    const bool last = k + 1 == report.increments.size();
    py::dict row;
    row["time_s"] = r.time;
    row["increment"] = r.number;
    put(row, "front", r.front, "_m");
    put(row, "most", r.most, "_m");
    row["K_I_Pa_m05"] = r.intensities[0];
    row["K_II_Pa_m05"] = r.intensities[1];
    row["K_III_Pa_m05"] = r.intensities[2];
    row["G_J_m2"] = r.release;
    row["toughness_J_m2"] = r.toughness;
    row["advance_m"] = r.advance;
    row["triangles"] = r.triangles;
    row["area_m2"] = r.area;
    row["front_m"] = r.front_length;
    row["tool_J"] = r.ledger.tool;
    row["loads_J"] = r.ledger.loads;
    row["elastic_J"] = r.ledger.elastic;
    row["surface_J"] = r.ledger.surface;
    row["dissipation_J"] = r.ledger.dissipation;
    row["imbalance_J"] = r.ledger.imbalance();
    row["force_N"] = r.force;
    row["nodes"] = r.body.nodes;
    row["kept_nodes"] = r.body.kept_nodes;
    row["intensities_s"] = r.intensity_seconds;
    put(row, r.body.seconds);
    row["update"] = std::string(to_string(r.body.update));
    row["update_reason"] = r.body.update_reason;
    row["unstable"] = last && report.unstable;
    row["severed"] = last && report.severed;
    row["reason"] = last ? report.reason : std::string();
    rows.append(row);
  }
  return rows;
}

} // namespace spherecut::bindings
