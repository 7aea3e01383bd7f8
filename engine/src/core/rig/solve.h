// Symmetric systems of equations, which need not be positive definite.
#pragma once

#include <cstddef>
#include <vector>

namespace dermis {

/// The decomposition P A Pᵀ = L D Lᵀ of a symmetric matrix, where D has blocks of one or two rows
/// (Bunch and Parlett 1971: the pivot is searched in all that remains). O(size³).
class SymmetricSolver {
 public:
  /// `matrix` by rows; only its lower triangle is read.
  SymmetricSolver(std::vector<double> matrix, std::size_t size);

  /// Whether a pivot is 0, or so small that its digits are lost.
  bool isSingular() const { return isSingular_; }
  /// The solution for one right-hand side. Only if it is not singular.
  std::vector<double> solve(const std::vector<double>& right) const;

 private:
  double& at(std::size_t row, std::size_t column) { return values_[row * size_ + column]; }
  double at(std::size_t row, std::size_t column) const { return values_[row * size_ + column]; }
  void swap(std::size_t a, std::size_t b);
  std::size_t choosePivot(std::size_t step);
  void eliminate(std::size_t step, std::size_t rows);

  std::size_t size_;
  std::vector<double> values_;  ///< all of the matrix; then L below the blocks of D
  std::vector<std::size_t> order_;
  std::vector<std::size_t> blocks_;  ///< rows of each
  bool isSingular_ = false;
};

}  // namespace dermis
