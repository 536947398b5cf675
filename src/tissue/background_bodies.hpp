// Bodies made in the background, on threads of their own: the body as it is goes on meanwhile.
#pragma once

#include "src/tissue/cut_report.hpp"
#include "topology/tool/contact.hpp"

#include <functional>
#include <future>

namespace spherecut::app {

/// A body that was made in the background, and how.
struct BackgroundBody {
  BodyModel model;
  BodyUpdate report;
};

/// One body at a time is computed. It follows the tool or a cut, or it is what a blade that is resisted will cut next.
/// What is taken or dropped is not there any more; what is dropped is computed to its end before the next one begins.
class BackgroundBodies {
 public:
  using Make = std::function<BackgroundBody()>;

  /// A body that follows.
  struct Following {
    std::optional<topology::SurfaceContact> centre; // of its fine zone; empty: it follows a cut
    double time = 0;                                // s, of the step that made the cut
    int triangles = 0;                              // of the cut
  };
  /// What a blade that is resisted will cut next.
  struct Proposing {
    std::size_t poses = 0;
    double time = 0;     // s, of the step that began it
    double way_left = 0; // m, of the blade then
    int triangles = 0;   // of the cut
  };

  void follow(const Following& what, Make make) { following_ = {what, begin(std::move(make))}; }
  void propose(const Proposing& what, Make make) { proposing_ = {what, begin(std::move(make))}; }

  [[nodiscard]] bool is_following() const { return following_.has_value(); }
  [[nodiscard]] bool follows_cut() const { return following_ && !following_->what.centre; }
  /// Null: there is none.
  [[nodiscard]] const Proposing* proposing() const { return proposing_ ? &proposing_->what : nullptr; }
  /// Whether that is there and the next step is to take it.
  [[nodiscard]] bool has_arrived() const { return proposing_ && proposing_->arrived; }

  /// The one that follows, and what it is for; get() waits for it, and throws what making it has thrown.
  std::pair<Following, std::future<BackgroundBody>> take_following();
  /// Likewise.
  std::pair<Proposing, std::future<BackgroundBody>> take_proposing();
  void drop_following();
  void drop_proposing();
  /// Waits for the proposed one; the next step is to take it.
  void let_arrive();

  [[nodiscard]] bool is_under_way() const { return following_ || proposing_; }
  /// Whether it is there, and has not been let arrive yet.
  [[nodiscard]] bool is_there() const;

 private:
  template <class What>
  struct Making {
    What what;
    std::future<BackgroundBody> made;
    bool arrived = false;
  };
  std::future<BackgroundBody> begin(Make make);

  std::future<BackgroundBody> unwanted_; // one that nobody will take
  std::optional<Making<Following>> following_;
  std::optional<Making<Proposing>> proposing_;
};

} // namespace spherecut::app
