#include "solvers/algebra/partial_factorisation.hpp"

#include "topology/base/errors.hpp"

#include <algorithm>
#include <dmumps_c.h>
#include <fmt/format.h>
#include <mutex>

namespace spherecut::solvers {

namespace {

// Its manual counts the parameters from one.
enum Control { ordering_kind = 7, system = 9, workspace_percent = 14, threads = 16, complement = 19, rhs_block = 27 };
enum Job { begin = -1, end = -2, analyse = 1, factorise = 2, solve_job = 3 };
constexpr int use_comm_world = -987654;
constexpr int given_ordering = 1, minimum_degree = 0, by_rows = 1;
constexpr int out_of_workspace = -9, out_of_integer_workspace = -8;
constexpr double lost_digits = 1e-3; // of a known solution: what is worse conditioned is singular
constexpr int most_workspace = 800;  // per cent beyond what the analysis expects

/// MUMPS keeps data of the instance at work in modules that all instances share.
std::mutex& at_work() {
  static std::mutex mutex;
  return mutex;
}

class MumpsElimination final : public PartialFactorisation {
 public:
  MumpsElimination(const SparseMatrix& matrix, const std::vector<int>& kept, const std::vector<int>& ordering)
      : size_(static_cast<int>(matrix.rows())), kept_(kept) {
    for (int column = 0; column < matrix.outerSize(); ++column)
      for (SparseMatrix::InnerIterator entry(matrix, column); entry; ++entry) {
        row_.push_back(static_cast<int>(entry.row()) + 1);
        column_.push_back(column + 1);
        value_.push_back(entry.value());
      }
    for (const int unknown : kept)
      kept_list_.push_back(unknown + 1);
    complement_.resize(kept.size() * kept.size());
    const std::lock_guard guard(at_work());
    call(begin);
    try {
      for (int stream = 1; stream <= 4; ++stream)
        control(stream) = -1; // says nothing
      control(ordering_kind) = minimum_degree;
      control(threads) = 1;
      control(rhs_block) = -64;
      control(complement) = kept.empty() ? 0 : by_rows;
      mumps_.n = size_;
      mumps_.nnz = static_cast<MUMPS_INT8>(value_.size());
      mumps_.irn = row_.data();
      mumps_.jcn = column_.data();
      mumps_.a = value_.data();
      mumps_.size_schur = static_cast<int>(kept_list_.size());
      mumps_.listvar_schur = kept_list_.data();
      mumps_.schur = complement_.data();
      if (!ordering.empty()) {
        // What is kept comes last, as MUMPS wants it.
        position_.assign(ordering.size(), 0);
        std::vector<char> is_kept(ordering.size(), 0);
        for (const int unknown : kept)
          is_kept[unknown] = 1;
        int next = 0;
        for (const int unknown : ordering)
          if (is_kept[unknown] == 0)
            position_[unknown] = ++next;
        for (const int unknown : kept)
          position_[unknown] = ++next;
        control(ordering_kind) = given_ordering;
        mumps_.perm_in = position_.data();
      }
      require(analyse, "analysis");
      for (int percent = 30;; percent *= 3) {
        control(workspace_percent) = percent;
        call(factorise);
        const int status = mumps_.infog[0];
        if ((status != out_of_workspace && status != out_of_integer_workspace) || percent > most_workspace)
          break;
      }
      if (mumps_.infog[0] < 0)
        throw NumericalError(fmt::format("the collocation matrix is singular away from the cut (MUMPS status {}, {}): "
                                         "the body is not held, or a support is unsound",
                                         mumps_.infog[0], mumps_.infog[1]));
      probe(matrix);
    } catch (...) {
      call(end);
      throw;
    }
    row_ = {};
    column_ = {};
    value_ = {};
  }
  ~MumpsElimination() override {
    const std::lock_guard guard(at_work());
    call(end);
  }
  MumpsElimination(const MumpsElimination&) = delete;
  MumpsElimination& operator=(const MumpsElimination&) = delete;

  MatrixX take_complement() override {
    const auto count = std::ssize(kept_);
    MatrixX result = Eigen::Map<const MatrixX>(complement_.data(), count, count).transpose();
    complement_ = {};
    return result;
  }

  MatrixX solve_eliminated(const MatrixX& right_hand_sides, bool transposed) const override {
    if (right_hand_sides.cols() == 0)
      return right_hand_sides;
    const std::lock_guard guard(at_work());
    return solve_locked(right_hand_sides, transposed);
  }

  long nonzeros() const override {
    const int count = mumps_.infog[28]; // INFOG(29), in millions where negative
    return count < 0 ? -1000000L * count : count;
  }

 private:
  /// MUMPS does not tell a singular A_FF from others where a complement is asked for: A_FF 1 has the solution 1.
  void probe(const SparseMatrix& matrix) const {
    VectorX ones = VectorX::Ones(size_);
    for (const int unknown : kept_)
      ones[unknown] = 0;
    const VectorX found = solve_locked(matrix * ones, false).col(0);
    const double error = (found - ones).lpNorm<Eigen::Infinity>();
    if (!(error < lost_digits))
      throw NumericalError(fmt::format("the collocation matrix is singular to rounding away from the cut (error {:.1e} "
                                       "of a known solution): the body is not held, or a support is unsound",
                                       error));
  }
  [[nodiscard]] MatrixX solve_locked(const MatrixX& right_hand_sides, bool transposed) const {
    MatrixX solution = right_hand_sides;
    const auto clear_kept = [&] {
      for (const int unknown : kept_)
        solution.row(unknown).setZero();
    };
    clear_kept();
    mumps_.icntl[system - 1] = transposed ? 0 : 1;
    mumps_.nrhs = static_cast<int>(solution.cols());
    mumps_.lrhs = size_;
    mumps_.rhs = solution.data();
    require(solve_job, "solution");
    clear_kept();
    return solution;
  }
  int& control(int parameter) { return mumps_.icntl[parameter - 1]; }
  void call(Job job) const {
    mumps_.job = job;
    if (job == begin) {
      mumps_.comm_fortran = use_comm_world;
      mumps_.par = 1;
      mumps_.sym = 0;
    }
    dmumps_c(&mumps_);
  }
  void require(Job job, const char* what) const {
    call(job);
    if (mumps_.infog[0] < 0)
      throw NumericalError(
          fmt::format("partial {} failed (MUMPS status {}, {})", what, mumps_.infog[0], mumps_.infog[1]));
  }

  int size_;
  std::vector<int> kept_;
  std::vector<int> row_, column_, kept_list_, position_;
  std::vector<double> value_, complement_;
  mutable DMUMPS_STRUC_C mumps_{};
};

/// All is kept.
class Nothing final : public PartialFactorisation {
 public:
  Nothing(const SparseMatrix& matrix, const std::vector<int>& kept) : all_(MatrixX(matrix)(kept, kept)) {}
  MatrixX take_complement() override { return std::move(all_); }
  MatrixX solve_eliminated(const MatrixX& right_hand_sides, bool) const override {
    return MatrixX::Zero(right_hand_sides.rows(), right_hand_sides.cols());
  }
  long nonzeros() const override { return static_cast<long>(all_.size()); }

 private:
  MatrixX all_;
};

} // namespace

std::unique_ptr<PartialFactorisation> factor_partly(const SparseMatrix& matrix, const std::vector<int>& kept,
                                                    const std::vector<int>& ordering) {
  if (std::ssize(kept) == matrix.rows())
    return std::make_unique<Nothing>(matrix, kept);
  return std::make_unique<MumpsElimination>(matrix, kept, ordering);
}

} // namespace spherecut::solvers
