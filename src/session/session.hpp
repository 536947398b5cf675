// One run: the organ, its nodes about contact and cuts, the tool pressed into it and the blade drawn through it, step
// by step. A step reads like the paper: contact, sprinkle, supports and collocation, solve, force [De 2001, sections 2
// and 3]. A cut goes before it: blade at rest, incision, wound, sprinkle, assemble.
#pragma once

#include "src/blade/force.hpp"
#include "src/model/finite_model.hpp"
#include "src/model/incision_builder.hpp"
#include "src/model/node_zone.hpp"
#include "src/model/organ_walls.hpp"
#include "src/scenario/schedule.hpp"
#include "src/session/cut_report.hpp"
#include "src/session/tear_report.hpp"

#include "solvers/fracture/tearing.hpp"
#include "topology/incision/front_growth.hpp"

#include <functional>
#include <future>

namespace spherecut::app {

/// What a step had to do with a body that was built or updated.
enum class Rebuild : std::uint8_t {
  none,
  in_step,     // it did that, or waited for it
  aside,       // it took over what had been made beside the steps
  aside_early, // before the blade had gone a third of the way on which it need not wait
};

/// Outcome of one step.
struct StepResult {
  double time = 0; // s
  topology::ToolPose pose;
  Vector3 force = Vector3::Zero();      // N, of the organ on the tool
  Vector3 torque = Vector3::Zero();     // N m, of the organ on the tool about its reference point, pose.point
  Vector3 tangential = Vector3::Zero(); // N, the part of it along the surface (solvers::tangential_force)
  topology::SurfaceContact contact;     // deepest point on the surface at rest
  double contact_radius = 0;            // m
  int active_nodes = 0, candidates = 0, nodes = 0;
  int iterations = 0;
  bool converged = true;
  double residual = 0;            // largest unbalanced force / largest force
  double largest_penetration = 0; // m, deepest that the deformed surface lies in the tool
  double self_penetration = 0;    // m, deepest that it reaches through itself, from node to node
  double rotation_degrees = 0;    // largest rotation of the tissue
  double least_jacobian = 1;      // least volume ratio of a body at finite strain
  bool resprinkled = false;       // the fine zone has followed the tool
  double force_jump = 0;          // |force after - before| / |force before| at the re-sprinkle
  Rebuild rebuild = Rebuild::none;
  double seconds = 0;             // wall clock of the step
  std::optional<CutReport> cut;   // in a scenario that cuts
  std::optional<TearReport> tear; // in one that tears, from the first solution on
};

/// Wall clock of each stage, s, summed over the run.
struct SessionProfile {
  double organ = 0, sprinkle = 0, discretise = 0, condense = 0, press = 0, evaluate = 0, topology = 0, level_sets = 0;
  double intensities = 0; // at the fronts of tears
};

/// Fine spacings ahead of the blade for which a body is condensed: in the step that needs it.
inline constexpr double way_spacings = 3;

/// Fine spacings of blade.advance where it is left out and a body is made beside the steps, and times blade.advance
/// that a blade goes on before the steps wait for that.
inline constexpr double aside_advance = 0.5, most_advances = 3;

/// Who leads the tool: the scenario's path, or a device, to which the path says no more than where nodes are fine at
/// first.
enum class Leader { path, device };

/// Of the spacing: deepest that a point of the surface may be left in the tool.
inline constexpr double most_left_over = 0.02;

class Session {
 public:
  /// Builds and checks organ, motion, precuts and fixed regions; sprinkles when something touches or cuts the organ, or
  /// may do so in a device's hand. Throws InputError.
  explicit Session(
      Scenario scenario, std::function<void(const std::string&)> say = [](const std::string&) {},
      Leader leader = Leader::path);

  [[nodiscard]] const std::vector<StepSample>& steps() const { return steps_; }
  /// False: there is no tool, or its path leads it and never touches the organ: every step is free of its force.
  [[nodiscard]] bool touches() const { return touch_.has_value(); }
  /// Whether there is a blade or a precut, or tissue that tears.
  [[nodiscard]] bool cuts() const { return scenario_.blade || !scenario_.precuts.empty() || tears(); }
  [[nodiscard]] bool tears() const { return scenario_.tearing.enabled; }
  /// Whether the tissue has a load of its own, that of weight or pretension.
  [[nodiscard]] bool has_loads() const { return scenario_.gravity || !scenario_.pretension.isZero(); }
  /// Whether there is anything to compute: else every step leaves the organ at rest.
  [[nodiscard]] bool computes() const { return touches() || cuts() || has_loads(); }
  /// Whether a grasper holds the tissue: its patch is bonded to it.
  [[nodiscard]] bool grasps() const { return grasp_.has_value(); }

  /// Goes on to a step of steps(), in their order: cuts, moves the tool, solves, tears. A cut or an increment of a tear
  /// that is refused leaves everything as it was, and says why in the result and once in warnings(). Throws
  /// NumericalError, and InputError when a grasper cannot reach the tissue.
  StepResult step(const StepSample& sample);

  /// Builds the body and condenses it onto the tool's candidates before the first touch, so that the first step in
  /// contact need not; with set_recondensing() so that it can follow the first cut, where the scenario's blade begins
  /// near it and every step follows it. `sample`: where the tool is. Does nothing when there is nothing to compute.
  void prepare(const StepSample& sample);

  /// Poses that the blade has passed since the last step, in order, before the one of the next: its way leads through
  /// them.
  void pass_blade(std::vector<topology::BladePose> poses) { passed_ = std::move(poses); }
  /// Where it was in the last step that had one.
  [[nodiscard]] const std::optional<topology::BladePose>& last_blade() const { return last_blade_; }

  /// The blade leaves the tissue where it is, and the next step that has one only places it: its way does not cut in
  /// between. From now on its way is not taken to be the scenario's: nodes are fine at the front of the cut.
  void lift_blade();

  [[nodiscard]] const Scenario& scenario() const { return scenario_; }
  [[nodiscard]] const Organ& organ() const { return organ_; }
  [[nodiscard]] const solvers::Sprinkling& sprinkling() const { return model_.sprinkling; }
  [[nodiscard]] const FineZone& zone() const { return zone_; }
  [[nodiscard]] const OrganWalls& walls() const { return walls_; }
  /// Null before the first step that needs it, and where the law is not linear.
  [[nodiscard]] const solvers::Discretisation* body() const { return model_.body.get(); }
  /// Solution of the last step.
  [[nodiscard]] const solvers::Field& field() const { return model_.field; }
  /// On: steps find contact and force alone and leave out what only output needs, node_states(), the residual, the
  /// opening volume and the hash of the wound; the rotation of the tissue is then not watched.
  void set_force_only(bool on) { force_only_ = on; }

  /// Whether a grasper is closed, from the next step on: a hand's in place of the times of the scenario; empty: by
  /// those.
  void set_grip(std::optional<bool> closed) { grip_ = closed; }

  /// On: the last of steps() is not the end, and what is put off there waits for the steps that follow.
  void set_going_on(bool on) { goes_on_ = on; }

  /// On: a tear makes one increment a step at most, and goes on in the next: a loop in real time gets its solutions.
  void set_tear_gradually(bool on) { tear_gradually_ = on; }

  /// Off: every cut builds its system from scratch, on the nodes that an update would have; what updates are measured
  /// by.
  void set_updating(bool on) { updating_ = on; }

  /// On: a body that follows its cut by updates is condensed anew beside them, on a thread of its own, when its window
  /// runs out or it has drifted, and so is one that a blade comes near to for the first time. It takes over where an
  /// update needs it, which waits for it, or at swap_body(). Cuts then give their residual now and then. When it
  /// begins, and what it becomes, depends on the steps alone.
  void set_recondensing(bool on);

  /// On: nodes that follow a tool are sprinkled, and their body assembled and condensed, on a thread of their own, and
  /// so are those that follow a cut which was put off (blade.advance), or which the blade has left off at rest. It
  /// takes over at swap_body(), or, after waiting for it, once the contact has left the fine zone that it would
  /// replace, or the blade has gone most_advances times blade.advance since; until then cut and wound are those of the
  /// body. When it begins, and what it becomes, depends on the steps alone. So is what a blade that the tissue resists
  /// proposes to cut, for which it is waited when the blade leaves the body, too.
  void set_following_aside(bool on);

  /// Whether a cut is put off that the next step would make if the blade rested.
  [[nodiscard]] bool has_put_off() const {
    return (put_off_ > 0 && follows_cuts_aside() && !cuts_aside()) ||
           (proposes_aside() && !proposing_ && blade_force_->lags());
  }

  /// Whether the blade has gone where the body has not followed it yet.
  [[nodiscard]] bool lags_behind_blade() const {
    return put_off_ > 0 || cuts_aside() || (proposes_aside() && blade_force_->lags());
  }

  /// Whether a body is under way beside the steps; and whether it is there and has followed what was cut meanwhile, but
  /// for the last few increments where every step has one: swap_body() has it follow those.
  [[nodiscard]] bool recondensing() const { return recondensing_ != nullptr || following_ || proposing_; }
  [[nodiscard]] bool recondensed() const;
  /// Takes it over, after waiting for it where need be; the next step solves with it. False: there is none, or it could
  /// not follow. Throws what making nodes and body anew throws.
  bool swap_body();

  /// Spacings `factor` times the scenario's from the next sprinkling on. Throws InputError unless it is positive.
  void coarsen(double factor);

  /// Body, condensed patch and contact of the last step, for the haptic loop.
  [[nodiscard]] const BodyModel& model() const { return model_; }
  /// What the blade feels; null: nothing resists it.
  [[nodiscard]] const BladeForce* blade() const { return blade_force_.get(); }
  /// The cut so far; null: none.
  [[nodiscard]] const topology::Incision* incision() const { return model_.incision.get(); }
  /// The surface with the cut so far; in a scenario without cuts it is not made.
  [[nodiscard]] const topology::Wound* wound() const {
    return !cuts() ? nullptr : shown_wound_ ? &*shown_wound_ : &incisions_->wound();
  }
  /// Displacement and stress at a point of the body in the last step; at rest before the first.
  [[nodiscard]] solvers::PointState at(const Vector3& x) const;
  /// Displacement, gradient and stress at every node in the last step.
  [[nodiscard]] const std::vector<solvers::PointState>& node_states() const { return node_states_; }
  [[nodiscard]] const SessionProfile& profile() const { return profile_; }
  /// Said once each: stretched linear elasticity, jumps at re-sprinkles, contact that did not converge, refused cuts.
  [[nodiscard]] const std::vector<std::string>& warnings() const { return warnings_; }

 private:
  void lay_out_zone();
  void approach_hanging();
  void follow_walls();
  void judge_walls();
  void find_gaps();
  void watch_blade_way();
  [[nodiscard]] std::vector<std::array<Vector3, 2>> fine_segments(const topology::Incision& incision) const;
  [[nodiscard]] topology::SurfaceContact find_contact(const topology::ToolPose& pose) const;
  [[nodiscard]] topology::SurfaceContact centre_of(const topology::SurfaceContact& contact,
                                                   const topology::ToolPose& pose) const;
  [[nodiscard]] bool must_follow(const topology::SurfaceContact& contact) const;
  [[nodiscard]] bool leaves_zone(const topology::SurfaceContact& contact) const;
  [[nodiscard]] std::optional<solvers::GripMemory> remembered_grip() const;
  [[nodiscard]] topology::SurfaceContact next_zone(const topology::SurfaceContact& contact) const;
  void follow(const StepSample& sample, const topology::SurfaceContact& centre, StepResult& result);
  [[nodiscard]] solvers::SprinkleOptions sprinkle_options(const BodyModel& model) const;
  void sprinkle(const solvers::NodeCloud* previous, BodyModel& model);
  [[nodiscard]] std::vector<int> candidates(const BodyModel& model) const;
  [[nodiscard]] std::optional<Vector3> facing() const;
  [[nodiscard]] bool tool_in_reach() const;
  void build(BodyModel& model);
  void assemble(BodyModel& model, const topology::SurfaceMesh& way_ahead, const std::vector<int>& near);
  void condense(const std::vector<int>& candidates, BodyModel& model, bool for_few_presses = false);
  void extend_fields(BodyModel& model);
  void solve(const StepSample& sample, BodyModel& model);
  [[nodiscard]] std::vector<int> press_surface(const ToolSettings* tool, const topology::ToolPose* pose,
                                               BodyModel& model);
  bool lift_shares(const SurfaceWatch::Depths& depths, const topology::ToolPose& pose, BodyModel& model) const;
  [[nodiscard]] std::vector<int> touchable(std::vector<int> nodes, const topology::ToolPose& pose,
                                           const BodyModel& model) const;
  [[nodiscard]] const VectorX& displacements_of(const BodyModel& model) const;
  [[nodiscard]] std::vector<int> penetrated_outside_patch(const topology::ToolPose& pose, const BodyModel& model) const;
  bool move_blade(const StepSample& sample, CutReport& report);
  bool cut(const StepSample& sample, CutReport& report);
  void refuse_cut(double time, const char* why, CutReport& report);
  /// An increment of the cut, for a body to follow.
  struct CutGrowth {
    std::function<topology::SurfaceMesh()> way_ahead; // where the cut is going to be next
    std::string renewed{};                            // why all nodes are made anew; empty: those beside it are
    bool window_pays = true;                          // for later increments to be followed
    bool beside = false;                              // the body as it is stays
  };
  void build_cut(const CutGrowth& growth, BodyModel& next, BodyUpdate& report);
  bool take_back_cut(const solvers::Discretisation* body);
  void condense_again();
  void lead_zone(const topology::Incision& incision, CutGrowth& growth);
  [[nodiscard]] topology::SurfaceMesh way_of_front(const topology::Incision* before,
                                                   const topology::Incision& now) const;
  [[nodiscard]] topology::SurfaceMesh way_of_blade(const StepSample& sample, const topology::RestMap& to_rest) const;
  [[nodiscard]] std::vector<topology::BladePose>
  blade_ahead(const StepSample& sample, const std::optional<topology::BladePose>& last, double length) const;
  [[nodiscard]] solvers::BodyGrowth follow_cut(const std::function<topology::SurfaceMesh()>& way_ahead, BodyModel& next,
                                               BodyUpdate& report);
  /// Whether a body that follows the blade's cut by updates is condensed anew beside the steps. Others are rebuilt.
  [[nodiscard]] bool renews_windows() const {
    return recondensing_on_ && scenario_.blade && blade_force_ == nullptr && !tears() && !follows_cuts_aside() &&
           !cut_appends(scenario_);
  }
  void watch_window(const StepSample& sample, const std::optional<topology::BladePose>& last, StepResult& result);
  void meet_blade(const StepSample& sample, const std::optional<topology::BladePose>& last);
  void begin_recondensing(const StepSample& sample, const std::optional<topology::BladePose>& last, double entry);
  [[nodiscard]] topology::SurfaceMesh way_ahead_of(const StepSample& sample,
                                                   const std::optional<topology::BladePose>& last, double length) const;
  [[nodiscard]] double way_into_body(const StepSample& sample) const;
  bool take_recondensed(BodyModel& into, solvers::ContactPatch& patch);
  void lead_recondensing(const StepSample& sample, const topology::RestMap& to_rest);
  void drop_recondensing();
  void follow_aside(const StepSample& sample, const topology::SurfaceContact& centre);
  void begin_following(const topology::SurfaceContact& centre);
  [[nodiscard]] bool follows_cuts_aside() const;
  [[nodiscard]] double advance() const;
  [[nodiscard]] bool ends(const StepSample& sample) const { return !goes_on_ && sample.time == steps_.back().time; }
  [[nodiscard]] bool may_cut_aside(const StepSample& sample) const;
  [[nodiscard]] bool cuts_aside() const { return following_ && !following_->centre; }
  struct MadeAside;
  [[nodiscard]] std::future<MadeAside> make_beside(std::shared_ptr<const topology::Incision> incision,
                                                   const char* reason);
  void begin_cutting(std::shared_ptr<const topology::Incision> incision, double time, CutReport& report);
  void take_following();
  void take_cut();
  void wait_for_cut(const StepSample& sample, CutReport& report);
  void drop_following();
  [[nodiscard]] Vector3 rest_position(const Vector3& x) const { return rest_position(x, model_); }
  [[nodiscard]] Vector3 rest_position(const Vector3& x, const BodyModel& model) const;
  [[nodiscard]] Vector3 find_rest(const Vector3& x, const BodyModel& model) const;
  [[nodiscard]] std::vector<Vector3> nearest_moved(const Vector3& x, const BodyModel& model) const;
  void make_blade_force();
  [[nodiscard]] bool blade_enters(const StepSample& sample) const;
  [[nodiscard]] bool proposes_aside() const;
  double press_blade(const StepSample& sample, CutReport& report);
  double cut_on(const StepSample& sample, bool aside, CutReport& report);
  bool sweep_proposal(const std::vector<topology::BladePose>& poses, const StepSample& sample, CutReport& report);
  bool begin_proposal(const std::vector<topology::BladePose>& poses, const StepSample& sample, CutReport& report);
  void take_proposal(const StepSample& sample, CutReport& report);
  [[nodiscard]] std::optional<BodyModel> propose_cut(const std::vector<topology::BladePose>& poses,
                                                     const StepSample& sample, CutReport& report);
  void check_pieces(double time);
  void check_held(double time);
  [[nodiscard]] std::optional<FirstTouch> find_touch(const std::vector<ToolSample>& motion, Leader leader) const;
  [[nodiscard]] FirstTouch find_grasp(const std::vector<ToolSample>& motion, Leader leader) const;
  [[nodiscard]] std::vector<int> grasped_nodes(const BodyModel& model) const;
  [[nodiscard]] bool grasped_piece_is_free() const;
  bool handle_grasper(const StepSample& sample);
  [[nodiscard]] std::vector<Vector3> grasped_displacements(const topology::ToolPose& pose,
                                                           const BodyModel& model) const;
  /// What a step has done before it tears.
  struct Loading {
    bool releases = false;  // a grasper has let go
    double cut_surface = 0; // J, that a blade's cut takes
  };
  class TearLoop;
  void tear(const StepSample& sample, const Loading& loading, StepResult& result);
  void book_loading(const StepSample& sample, const Loading& loading);
  [[nodiscard]] bool follows_load(const StepSample& sample, const Loading& loading) const;
  void drop_blade_proposal();
  [[nodiscard]] double drawn_open(const BodyModel& model, const topology::Incision& after) const;
  [[nodiscard]] std::vector<solvers::FrontState> front_states() const;
  [[nodiscard]] std::optional<std::vector<solvers::FrontState>> known_states() const;
  [[nodiscard]] std::optional<topology::SurfaceMesh> seed_of_tear() const;
  [[nodiscard]] topology::FrontGrowth grow_tear(const std::vector<solvers::FrontState>& states, double longest) const;
  [[nodiscard]] topology::FrontGrowth join_tears(const std::vector<solvers::FrontState>& states) const;
  bool take_tear(const StepSample& sample, const std::function<void()>& grow, TearReport& report, BodyUpdate& update);
  void report_cut(CutReport& report) const;
  void report_opening(const topology::Wound& wound, CutReport& report) const;
  [[nodiscard]] double depth_of_press(const topology::SurfaceContact& contact) const;
  void evaluate(StepResult& result);
  void evaluate_nodes(StepResult& result);
  void judge_fineness(const StepResult& result);
  [[nodiscard]] std::vector<Vector3> places_of_contact() const;
  void make_finite(BodyModel& model, const BodyModel* before = nullptr);
  void step_linear(const StepSample& sample, StepResult& result);
  bool begin_step(const StepSample& sample);
  bool cut_freely(const StepSample& sample, StepResult& result);
  void follow_tool(const StepSample& sample, StepResult& result);
  double press_resisted(const StepSample& sample, StepResult& result);
  void solve_finite(double time, const std::optional<topology::ToolPose>& pose, BodyModel& model);
  void build_finite_cut(BodyModel& next, BodyUpdate& report);
  void step_finite(const StepSample& sample, StepResult& result);
  void watch_banks(StepResult& result);
  void warn(const std::string& key, const std::string& text);

  /// A body that follows the tool or a cut, made on a thread of its own.
  struct MadeAside {
    BodyModel model;
    BodyUpdate report;
  };
  struct Following {
    std::optional<topology::SurfaceContact> centre; // of its fine zone; empty: it follows a cut
    double time = 0;                                // s, of the step that made the cut
    int triangles = 0;                              // of the cut
    std::future<MadeAside> made;
  };
  /// What a blade that is resisted will cut next.
  struct Proposing {
    std::size_t poses = 0;
    double time = 0;      // s, of the step that began it
    double way_left = 0;  // m, of the blade then
    int triangles = 0;    // of the cut
    bool arrived = false; // it is to be taken by the next step
    std::future<MadeAside> made;
  };
  /// Tissue in a grasper's jaws.
  struct Grasp {
    Vector3 place = Vector3::Zero(), normal = Vector3::UnitZ(); // m, on the surface at rest; outward there
    std::vector<Vector3> rest, displacement;                    // m, of the patch when it took hold
    std::vector<solvers::SeedNode> nodes;                       // its own and those about it: they stay while it holds
    topology::ToolPose pose;                                    // when it took hold
  };
  /// What the last step has left for the next one's account.
  struct TearAccount {
    EnergyLedger ledger;
    Energies last;
    Vector3 force = Vector3::Zero();        // N, on the tool
    std::optional<topology::ToolPose> pose; // of the tool
    double time = 0;                        // s
    double area = 0;                        // m2 torn
    double decay = 0;                       // 1/m, of the release rate with the way of the front, as last seen
    bool grows = false;                     // it has in the last step
    double start = 0;                       // G / G_c when the growth at this load began
    int kept = 0;                           // increments since then that have left most of it
    bool told = false;                      // that it is unstable
  };

  Scenario scenario_;
  std::function<void(const std::string&)> say_;
  SessionProfile profile_;
  Organ organ_;
  topology::ContactQuery query_;
  std::optional<FirstTouch> touch_;
  FineZone zone_;
  OrganWalls walls_;
  std::shared_ptr<const topology::Incision> gap_walls_; // null: no narrow gaps
  double coarseness_ = 1;                               // of the spacings in zone_
  std::vector<std::array<Vector3, 2>> tracks_;          // of the blade, where fine nodes belong
  std::vector<std::array<Vector3, 2>> led_segments_;    // of zone_ when it was last led ahead of a tear's front
  std::vector<StepSample> steps_;
  std::optional<topology::SurfaceContact> zone_contact_; // centre of the fine zone; empty: no tool touches
  std::optional<topology::SurfaceContact> first_zone_;   // the first of these
  std::unique_ptr<IncisionBuilder> incisions_;           // null in a scenario without cuts
  BodyModel model_;
  std::optional<topology::ToolPose> free_pose_; // of the tool before it touched
  double free_time_ = 0;                        // s, then
  std::unique_ptr<BladeForce> blade_force_;     // null: nothing resists the blade
  std::optional<IncisionBuilder::Mark> mark_;   // the cut without the blade's proposal
  std::optional<topology::Wound> shown_wound_;  // of the body while the cut is ahead of it; empty: that of the cut
  std::optional<solvers::Field> without_blade_; // field of model_ without blade; empty: that is model_.field
  std::optional<topology::SurfaceContact> last_contact_;
  bool seen_hanging_ = false;                     // the body has been built for approach_hanging() alone
  double put_off_ = 0;                            // m the edge has gone since the body last followed its cut
  std::optional<topology::BladePose> last_blade_; // where the blade was in the last step that had one
  std::vector<topology::BladePose> passed_;       // since then
  double blade_moved_ = 0;                        // s, when it last did
  bool blade_rests_ = true;                       // or there is none
  bool blade_lifted_ = false;                     // its next pose places it
  bool hand_led_ = false;                         // the blade goes where it likes, not along the scenario's path
  std::vector<solvers::PointState> node_states_;
  VectorX node_displacements_;                                      // m, 3 a node, in the last step
  mutable VectorX displaced_, displaced_coefficients_;              // at the nodes, of a field since solve() began
  mutable const solvers::Discretisation* displaced_body_ = nullptr; // of that field; null: none
  std::optional<SurfaceWatch::Depths> penetration_; // of the surface in the last solution; empty: not looked at
  std::optional<Grasp> grasp_;
  std::optional<bool> grip_; // a hand's; empty: by the times of the scenario
  bool lost_grip_ = false;   // the piece in the grasper has come off
  std::optional<TearAccount> tears_;
  std::function<double(const Vector3&)> toughness_; // J/m2, in the tissue at rest
  bool tear_gradually_ = false;
  bool goes_on_ = false;
  bool force_only_ = false;
  bool updating_ = true;
  bool lips_touch_ = false;                        // pairs were held in the last solution
  std::optional<solvers::GripMemory> grip_memory_; // friction at the start of the step, should its nodes change
  std::optional<solvers::GripMemory> kept_grip_;   // of a body that another has taken over from since the last step
  bool recondensing_on_ = false;
  std::unique_ptr<Recondensing> recondensing_, given_up_; // null: none
  topology::SurfaceMesh recondensing_way_;                // for which it is condensed
  std::optional<solvers::SprinkleIncrement> followed_;    // by the body of the last cut
  bool following_aside_ = false;
  bool followed_aside_ = false;     // its body has taken over since the last step
  Rebuild rebuild_ = Rebuild::none; // since the last step
  std::vector<std::string> warnings_;
  std::vector<std::string> warned_;
  std::optional<CutReport> aside_cut_; // whose body has taken over since the last step, or which was refused
  std::future<MadeAside> unwanted_;    // one that nobody will take
  std::optional<Following> following_; // empty: none; its thread uses the above
  std::optional<Proposing> proposing_; // the same
};

} // namespace spherecut::app
