// Scenarios and sessions: a run step by step, with everything that it writes as arrays.
#include "python/bindings/floors.hpp"
#include "python/bindings/tables.hpp"
#include "src/base/output_file.hpp"
#include "src/output/cut_output.hpp"
#include "src/output/run_output.hpp"
#include "src/run/run.hpp"
#include "src/scenario/keys.hpp"
#include "topology/base/errors.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <fmt/format.h>

namespace spherecut::bindings {
namespace {

using namespace py::literals;
using app::Scenario;
using app::Session;
using app::StepResult;
using app::StepSample;

/// A session with what it says, for one thread at a time and not from within itself.
struct RunningSession {
  std::unique_ptr<Session> session;
  std::mutex lock;
  bool is_busy = false; // its thread is in it and runs Python code now
};

template <class Call>
auto with_session(RunningSession& self, Call&& call) -> decltype(call(*self.session)) {
  if (self.is_busy)
    throw InputError("session: asked from within its own step; allowed: between steps");
  return unlocked([&] {
    const std::lock_guard guard(self.lock);
    return call(*self.session);
  });
}

using Words = std::function<void(const std::string&)>;

std::shared_ptr<RunningSession> session_from(const Scenario& scenario, const py::object& say,
                                             const std::string& leader) {
  if (leader != "path" && leader != "device")
    throw InputError(fmt::format("leader: '{}'; allowed: path, device", leader));
  auto self = std::make_shared<RunningSession>();
  Words words = [](const std::string&) {};
  if (!say.is_none())
    words = [function = Kept(say), owner = std::weak_ptr<RunningSession>(self)](const std::string& line) {
      const py::gil_scoped_acquire acquire;
      const auto session = owner.lock();
      if (session)
        session->is_busy = true;
      try {
        (*function)(line);
      } catch (...) {
        if (session)
          session->is_busy = false;
        throw;
      }
      if (session)
        session->is_busy = false;
    };
  const app::Leader who = leader == "path" ? app::Leader::path : app::Leader::device;
  unlocked([&] { self->session = std::make_unique<Session>(scenario, std::move(words), who); });
  return self;
}

py::list keys_of_scenarios() {
  py::list keys;
  for (const app::ScenarioKey& key : app::scenario_keys())
    keys.append(py::dict("path"_a = key.path, "type"_a = app::type_name(key.kind), "unit"_a = key.unit,
                         "allowed"_a = app::allowed_values(key), "default"_a = key.fallback, "meaning"_a = key.meaning,
                         "when"_a = key.when));
  return keys;
}

void bind_scenario(py::module_& module) {
  module.def("scenario_keys", keys_of_scenarios,
             "Every key of a scenario in the order of docs/scenario.md: dicts of texts with path ('fixed[].lower'), "
             "type, unit, "
             "allowed, default, meaning, when ('shape = block': only beside that).");
  py::class_<Scenario, std::shared_ptr<Scenario>>(module, "Scenario",
                                                  "A scenario as its file has it; every key: docs/scenario.md.")
      .def_static(
          "read",
          [](const std::filesystem::path& file) {
            return unlocked([&] { return std::make_shared<Scenario>(app::read_scenario(file)); });
          },
          "file"_a,
          "Reads and checks a file. Raises InputError with a line for every offence, as spherecut check does.")
      .def_static(
          "from_text",
          [](const std::string& text, const std::filesystem::path& file) {
            return unlocked([&] { return std::make_shared<Scenario>(app::read_scenario_text(file, text)); });
          },
          "text"_a, "file"_a = "scenario.toml",
          "The same from a text in TOML; files that it names are looked for beside file, which need not exist.")
      .def_readonly("text", &Scenario::text, "The text in TOML.")
      .def_property_readonly(
          "file", [](const Scenario& self) { return self.file.string(); }, "Name of the file.")
      .def_readonly("title", &Scenario::title, "Its title.")
      .def_readonly("material", &Scenario::material, "Material.")
      .def_readonly("toughness", &Scenario::toughness, "G_c, J/m2; 0: not given.")
      .def_property_readonly(
          "method", [](const Scenario& self) { return std::string(solvers::to_string(self.method.method)); },
          "Name of the method.")
      .def_property_readonly(
          "tool", [](const Scenario& self) { return self.tool ? std::optional(Tool{self.tool->shape}) : std::nullopt; },
          "Tool, or None.")
      .def_property_readonly(
          "blade_edge",
          [](const Scenario& self) {
            return self.blade ? std::optional(owned(std::vector<Vector3>(self.blade->edge))) : std::nullopt;
          },
          "(n, 3), m, in the blade's frame; None without a blade.")
      .def(
          "toughness_at",
          [](const Scenario& self, const Doubles& points) {
            const auto field = app::toughness_field(self);
            std::vector<double> values;
            for (const Vector3& x : one_or_more_points(points, "points"))
              values.push_back(field(x));
            return owned(std::move(values));
          },
          "points"_a, "(n,), J/m2: toughness with its layers at points, (n, 3), m, of the body at rest.")
      .def_property_readonly(
          "random_seed", [](const Scenario& self) { return self.nodes.random_seed; }, "Of its nodes.")
      .def(
          "with_random_seed",
          [](const Scenario& self, std::uint64_t seed) {
            auto copy = std::make_shared<Scenario>(self);
            copy->nodes.random_seed = seed;
            return copy;
          },
          "seed"_a, "The same scenario with other nodes: nodes.random_seed. Its text stays what it was.")
      .def(
          "with_toughness",
          [](const Scenario& self, const py::object& toughness) {
            if (!(self.toughness > 0))
              throw InputError("with_toughness: the scenario has no material.toughness; allowed: with one above 0");
            auto copy = std::make_shared<Scenario>(self);
            copy->toughness_function = number_function(toughness, "toughness");
            return copy;
          },
          "toughness"_a,
          "The same scenario with another toughness, J/m2: a number, or a function of a point of the body at rest, "
          "(3,), m. Blade and tears meet it in every session; a function is asked on the threads of the session. Its "
          "text stays what it was, and it cannot be pickled.")
      .def(
          "with_law",
          [](const Scenario& self, std::shared_ptr<solvers::Law> law) {
            auto copy = std::make_shared<Scenario>(self);
            const solvers::ElasticConstants moduli = law->small_strain();
            copy->material.young_modulus = moduli.young_modulus();
            copy->material.poisson_ratio = moduli.poisson_ratio();
            copy->law.own = std::move(law);
            return copy;
          },
          "law"_a,
          "The same scenario with another law, a Law, at finite strain: sessions press, grasp and cut it, under "
          "its weight, and raise InputError for a scenario that asks for more. Its text stays what it was, and it "
          "cannot "
          "be pickled.")
      .def(py::pickle(
          [](const Scenario& self) {
            if (self.law.own)
              throw InputError("pickle: a scenario with a law of its own; allowed: one as its file has it");
            if (self.toughness_function)
              throw InputError("pickle: a scenario with a toughness of its own; allowed: one as its file has it");
            return py::make_tuple(self.text, self.file.string(), self.nodes.random_seed);
          },
          [](const py::tuple& state) {
            auto scenario = std::make_shared<Scenario>(
                app::read_scenario_text(state[1].cast<std::string>(), state[0].cast<std::string>()));
            scenario->nodes.random_seed = state[2].cast<std::uint64_t>();
            return scenario;
          }));
}

py::array quaternion(const topology::BladePose& pose) {
  const Eigen::Quaterniond& q = pose.orientation;
  return owned(std::vector<double>{q.w(), q.x(), q.y(), q.z()});
}

void bind_samples(py::module_& module) {
  py::class_<topology::BladePose>(module, "BladePose", "Where the frame of a blade is at a time.")
      .def(py::init(&blade_pose_from), "time"_a, "position"_a,
           "orientation"_a = Doubles(owned(std::vector<double>{1, 0, 0, 0})),
           "time: s. position: (3,), m. orientation: (3, 3), a rotation, or (4,), a unit quaternion w, x, y, z.")
      .def_readonly("time", &topology::BladePose::time, "s.")
      .def_property_readonly(
          "position", [](const topology::BladePose& self) { return array_of(self.position); }, "(3,), m.")
      .def_property_readonly("orientation", &quaternion, "(4,): unit quaternion w, x, y, z.");
  py::class_<StepSample>(module, "Step", "One moment of a run: where tool and blade are.")
      .def(py::init([](double time, const std::optional<topology::ToolPose>& tool,
                       const std::optional<topology::BladePose>& blade) {
             if (!std::isfinite(time))
               throw InputError(fmt::format("time: {} s; allowed: finite", time));
             return StepSample{time, tool, blade};
           }),
           "time"_a, "tool"_a = py::none(), "blade"_a = py::none(), "time: s. tool: ToolPose. blade: BladePose.")
      .def_readonly("time", &StepSample::time, "s.")
      .def_readonly("tool", &StepSample::tool, "ToolPose, or None.")
      .def_readonly("blade", &StepSample::blade, "BladePose, or None where it is not on its way.");
}

void bind_results(py::module_& module) {
  py::class_<StepResult>(module, "StepResult", "Outcome of one step.")
      .def_readonly("time", &StepResult::time, "s.")
      .def_property_readonly(
          "force", [](const StepResult& self) { return array_of(self.force); }, "(3,), N, of the organ on the tool.")
      .def_property_readonly(
          "torque", [](const StepResult& self) { return array_of(self.torque); },
          "(3,), N m, of the organ on the tool about its reference point, the outermost point of its tip.")
      .def_property_readonly(
          "tangential", [](const StepResult& self) { return array_of(self.tangential); },
          "(3,), N: the part of it along the surface.")
      .def_property_readonly(
          "blade_force",
          [](const StepResult& self) { return array_of(self.cut ? self.cut->blade.force : Vector3(Vector3::Zero())); },
          "(3,), N, of the tissue on the blade; zero where the material has no toughness.")
      .def_property_readonly(
          "blade_torque",
          [](const StepResult& self) { return array_of(self.cut ? self.cut->blade.torque : Vector3(Vector3::Zero())); },
          "(3,), N m, of the same about the origin of the blade's frame.")
      .def_readonly("contact", &StepResult::contact, "SurfaceContact at rest.")
      .def_readonly("contact_radius", &StepResult::contact_radius, "m.")
      .def_readonly("nodes", &StepResult::nodes, "Number of nodes.")
      .def_readonly("converged", &StepResult::converged, "Whether the contact was found.")
      .def_readonly("residual", &StepResult::residual, "Largest unbalanced force over the largest force.")
      .def_readonly("seconds", &StepResult::seconds, "Wall clock of the step, s.")
      .def_property_readonly("forces", &force_row, "dict: the row of forces.csv, by its columns.")
      .def_property_readonly(
          "cut",
          [](const StepResult& self) {
            return self.cut ? std::optional(bindings::cut_row(self.time, *self.cut)) : std::nullopt;
          },
          "dict: the row of cuts.csv, by its columns (volumes_m3 is an array); None without cuts.")
      .def_property_readonly(
          "tear",
          [](const StepResult& self) {
            return self.tear ? std::optional(bindings::tear_rows(*self.tear)) : std::nullopt;
          },
          "List of dicts: the rows of tears.csv, by its columns; None without tearing.");
}

// Of the surface, the organ's or the wound's, as the frames of a run have it.
py::dict surface_of(RunningSession& self) {
  struct Surface {
    std::vector<Vector3> points, displacement;
    std::vector<Triangle> triangles;
    std::vector<double> von_mises;
    std::vector<int> part, piece, sheet;
  };
  Surface surface = with_session(self, [](const Session& session) {
    Surface made;
    const topology::Wound* wound = session.wound();
    const topology::SurfaceMesh& mesh = wound != nullptr ? wound->surface : session.organ().domain->surface();
    made.triangles = mesh.triangles;
    for (std::size_t v = 0; v < mesh.vertices.size(); ++v) {
      interruption_point();
      const solvers::PointState state = session.model().at(wound != nullptr ? wound->evaluation[v] : mesh.vertices[v]);
      made.displacement.push_back(state.displacement);
      made.von_mises.push_back(app::von_mises(state.stress));
      made.points.emplace_back(mesh.vertices[v] + state.displacement);
    }
    for (std::size_t t = 0; wound != nullptr && t < mesh.triangles.size(); ++t) {
      made.part.push_back(static_cast<int>(wound->part[t]));
      made.piece.push_back(wound->piece_of(static_cast<int>(t)));
      made.sheet.push_back(wound->sheet[t]);
    }
    return made;
  });
  py::dict arrays("points"_a = owned(std::move(surface.points)), "triangles"_a = owned(std::move(surface.triangles)),
                  "displacement"_a = owned(std::move(surface.displacement)),
                  "von_mises"_a = owned(std::move(surface.von_mises)));
  if (!surface.part.empty()) {
    arrays["part"] = owned(std::move(surface.part));
    arrays["piece"] = owned(std::move(surface.piece));
    arrays["sheet"] = owned(std::move(surface.sheet));
  }
  return arrays;
}

std::vector<solvers::FrontState> fronts_of(RunningSession& self, const std::optional<double>& spacing,
                                           const py::object& toughness) {
  NumberFunction resistance;
  if (!toughness.is_none())
    resistance = number_function(toughness, "toughness");
  return with_session(self, [&](const Session& session) -> std::vector<solvers::FrontState> {
    if (session.model().incision == nullptr || session.model().incision->front().empty() ||
        session.model().body == nullptr)
      return {};
    const app::BodyModel& model = session.model();
    std::vector<Vector3> closed;
    if (model.state)
      for (std::size_t p = 0; p < std::min(model.pairs.size(), model.state->lips.closed.size()); ++p)
        if (model.state->lips.closed[p] != 0)
          closed.push_back(model.sprinkling.nodes.positions[static_cast<std::size_t>(model.pairs[p].plus)]);
    if (!resistance) {
      resistance = app::toughness_field(session.scenario());
      if (!(session.scenario().toughness > 0))
        resistance = [](const Vector3&) { return 1.0; }; // intensities do not depend on it
    }
    return solvers::front_states(*session.model().body, session.model().field, resistance,
                                 spacing.value_or(session.zone().spacing.fine), closed,
                                 spacing ? nullptr : &model.front_rules);
  });
}

void bind_session_state(py::class_<RunningSession, std::shared_ptr<RunningSession>>& session) {
  session
      .def_property_readonly(
          "nodes",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) {
              return std::make_shared<solvers::NodeCloud>(s.model().sprinkling.nodes);
            });
          },
          "Nodes of the body now (a copy).")
      .def_property_readonly(
          "domain",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) { return variable(s.organ().domain); });
          },
          "Domain: the organ at rest.")
      .def_property_readonly(
          "incision",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) { return variable(s.model().incision); });
          },
          "Incision that the body follows now, or None.")
      .def_property_readonly(
          "wound",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) {
              return s.wound() != nullptr ? std::make_shared<topology::Wound>(*s.wound()) : nullptr;
            });
          },
          "Wound at rest (a copy), or None in a scenario without cuts.")
      .def_property_readonly(
          "fine_spacing",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) { return s.zone().spacing.fine; });
          },
          "m, of the nodes where they are fine.")
      .def(
          "at",
          [](RunningSession& self, const Doubles& points) {
            const std::vector<Vector3> x = one_or_more_points(points, "points");
            return with_session(self, [&](const Session& s) {
              PointValues values;
              for (const Vector3& point : x) {
                interruption_point();
                values.add(s.model().at(point));
              }
              return values;
            });
          },
          "points"_a, "PointValues in the last step at points, (n, 3), m, of the organ at rest.")
      .def(
          "node_values",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) {
              std::vector<solvers::PointState> states = s.node_states();
              states.resize(
                  static_cast<std::size_t>(s.model().sprinkling.nodes.size())); // at rest before the first solution
              return values_of(states);
            });
          },
          "PointValues of the last step at the nodes.")
      .def("surface", &surface_of,
           "Surface of the last step as frames have it, the wound's where there are cuts: dict of points (n, 3), m, "
           "moved; "
           "triangles (m, 3); displacement (n, 3), m; von_mises (n,), Pa; with cuts part, piece, sheet (m,).")
      .def("front_states", &fronts_of, "spacing"_a = py::none(), "toughness"_a = py::none(),
           "List of FrontState along the front of the cut in the last step, about spacing m apart; None: the fine "
           "spacing "
           "of the nodes. toughness: as front_states(); None: the scenario's, or 1 J/m2 where it has none.")
      .def_property_readonly(
          "warnings",
          [](RunningSession& self) { return with_session(self, [](const Session& s) { return s.warnings(); }); },
          "Said once each.")
      .def_property_readonly(
          "profile",
          [](RunningSession& self) {
            const app::SessionProfile p = with_session(self, [](const Session& s) { return s.profile(); });
            return py::dict("organ"_a = p.organ, "sprinkle"_a = p.sprinkle, "discretise"_a = p.discretise,
                            "condense"_a = p.condense, "press"_a = p.press, "evaluate"_a = p.evaluate,
                            "topology"_a = p.topology, "level_sets"_a = p.level_sets, "intensities"_a = p.intensities);
          },
          "dict: wall clock of each stage, s, summed.");
}

/// Sets one of the options of a session.
template <class Value>
auto switch_of(Value app::SessionOptions::*option) {
  return [option](RunningSession& self, Value value) {
    with_session(self, [&](Session& s) {
      app::SessionOptions options = s.options();
      options.*option = value;
      s.set_options(options);
    });
  };
}

void bind_session_steps(py::class_<RunningSession, std::shared_ptr<RunningSession>>& session) {
  session
      .def(py::init(&session_from), "scenario"_a, "say"_a = py::none(), "leader"_a = "path",
           "Builds and checks organ, motion and nodes. say: function of a line that it has to say. leader: 'path', the "
           "scenario's, or 'device', when the tool goes where it likes.")
      .def_property_readonly(
          "scenario",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) { return std::make_shared<Scenario>(s.scenario()); });
          },
          "Scenario (a copy).")
      .def_property_readonly(
          "steps", [](RunningSession& self) { return with_session(self, [](const Session& s) { return s.steps(); }); },
          "List of Step: the scenario's own way.")
      .def_property_readonly(
          "touches",
          [](RunningSession& self) { return with_session(self, [](const Session& s) { return s.touches(); }); },
          "Whether its tool touches the organ.")
      .def_property_readonly(
          "cuts",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) { return has_cuts(s.scenario()); });
          },
          "Whether there is a blade or a precut, or tissue that tears.")
      .def_property_readonly(
          "tears",
          [](RunningSession& self) {
            return with_session(self, [](const Session& s) { return s.scenario().tearing.enabled; });
          },
          "Whether its tissue tears.")
      .def(
          "prepare",
          [](RunningSession& self, const StepSample& sample) {
            with_session(self, [&](Session& s) { s.prepare(sample); });
          },
          "step"_a, "Builds the body before the first touch, so that the first step in contact need not.")
      .def(
          "step",
          [](RunningSession& self, const StepSample& sample) {
            return with_session(self, [&](Session& s) {
              interruption_point();
              return s.step(sample);
            });
          },
          "step"_a,
          "Goes on to a step, one of steps or another that is later than the last: cuts, moves the tool, solves, "
          "tears. "
          "A cut that is refused leaves everything as it was, and says why in the result.")
      .def(
          "require_tissue",
          [](RunningSession& self, const StepResult& result) {
            with_session(self, [&](const Session& s) { app::require_tissue(s, result); });
          },
          "result"_a, "Raises NumericalError where the step found what no tissue does; a run ends there.")
      .def(
          "lift_blade", [](RunningSession& self) { with_session(self, [](Session& s) { s.lift_blade(); }); },
          "The next step with a blade only places it.")
      .def(
          "coarsen",
          [](RunningSession& self, double factor) { with_session(self, [&](Session& s) { s.coarsen(factor); }); },
          "factor"_a, "Spacings factor times the scenario's from the next sprinkling on.")
      .def("set_grip", switch_of(&app::SessionOptions::grip), "closed"_a,
           "Whether a grasper is closed from the next step on; None: by the times of the scenario.")
      .def("set_force_only", switch_of(&app::SessionOptions::force_only), "on"_a,
           "On: steps leave out what only output needs: node_values(), the residual, the opening volume.")
      .def("set_following_aside", switch_of(&app::SessionOptions::following_in_background), "on"_a,
           "On: nodes that follow the tool, or a cut that was put off, are made in the background.")
      .def("set_tear_gradually", switch_of(&app::SessionOptions::tear_gradually), "on"_a,
           "On: a tear makes one increment a step at most.")
      .def("set_going_on", switch_of(&app::SessionOptions::going_on), "on"_a, "On: the last of steps is not the end.");
}

/// The files of a run, made step by step.
struct Results {
  std::filesystem::path folder;
  app::ResultsClaim claim;
  std::unique_ptr<app::RunOutput> output;
};

app::RunStatus status_from(const std::string& name) {
  if (name == "complete")
    return app::RunStatus::complete;
  if (name == "interrupted")
    return app::RunStatus::interrupted;
  if (name == "failed")
    return app::RunStatus::failed;
  throw InputError(fmt::format("status: '{}'; allowed: complete, interrupted, failed", name));
}

void bind_files(py::module_& module) {
  py::class_<Results>(module, "Results",
                      "The folder that a run on the command line writes: tables, frames, figures, summary.json.")
      .def(py::init([](const std::filesystem::path& folder, RunningSession& session) {
             auto results = std::make_unique<Results>();
             results->folder = folder;
             with_session(session, [&](const Session& s) {
               results->claim = app::claim_results_folder(folder);
               results->output = std::make_unique<app::RunOutput>(folder, s);
             });
             return results;
           }),
           "folder"_a, "session"_a, "The folder must not hold results yet.")
      .def(
          "add",
          [](Results& self, RunningSession& session, const StepResult& result) {
            with_session(session, [&](const Session& s) { self.output->add(s, result); });
          },
          "session"_a, "result"_a, "Rows and frame of the step that the session has just done.")
      .def(
          "finish",
          [](Results& self, RunningSession& session, const std::string& status, const std::string& message) {
            const app::RunStatus end = status_from(status);
            with_session(session, [&](const Session& s) {
              const app::RunFindings& found = self.output->findings();
              if (end == app::RunStatus::complete && found.steps > 0 && found.steps <= s.steps().size())
                self.output->check_pieces(s, s.steps()[found.steps - 1].time);
              if (end != app::RunStatus::failed)
                self.output->draw_figures(s);
              self.output->write_summary(s, end, message);
            });
            return self.output->files();
          },
          "session"_a, "status"_a = "complete", "message"_a = "",
          "Figures and summary.json; returns the names of the files. status: 'complete', 'interrupted' or 'failed'.");
}

} // namespace

topology::BladePose blade_pose_from(double time, const Doubles& position, const Doubles& orientation) {
  constexpr double unit = 1e-9;
  topology::BladePose pose;
  if (!std::isfinite(time))
    throw InputError(fmt::format("time: {} s; allowed: finite", time));
  pose.time = time;
  pose.position = vector_from(position, "position");
  if (orientation.ndim() == 1 && orientation.shape(0) == 4) {
    const double* q = orientation.data();
    pose.orientation = Eigen::Quaterniond(q[0], q[1], q[2], q[3]);
    if (!(std::abs(pose.orientation.norm() - 1) <= unit))
      throw InputError(
          fmt::format("orientation: a quaternion of length {:g}; allowed: 1, to {:g}", pose.orientation.norm(), unit));
    return pose;
  }
  const Matrix3 turn = matrix_from(orientation, "orientation");
  if (!((turn.transpose() * turn - Matrix3::Identity()).norm() <= unit) || !(turn.determinant() > 0))
    throw InputError(fmt::format("orientation: no rotation to {:g}; allowed: a rotation, (3, 3), or a unit quaternion, "
                                 "(4,)",
                                 unit));
  pose.orientation = Eigen::Quaterniond(turn);
  return pose;
}

void bind_session(py::module_& module) {
  bind_scenario(module);
  bind_samples(module);
  bind_results(module);
  py::class_<RunningSession, std::shared_ptr<RunningSession>> session(
      module, "Session", "A run of a scenario, step by step. One thread works with it at a time; others wait.");
  bind_session_steps(session);
  bind_session_state(session);
  bind_files(module);
}

} // namespace spherecut::bindings
