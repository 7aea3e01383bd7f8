#include "rig/solve.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "strict_floating_point.h"

namespace dermis {

SymmetricSolver::SymmetricSolver(std::vector<double> matrix, std::size_t size)
    : size_(size), values_(std::move(matrix)), order_(size) {
  std::iota(order_.begin(), order_.end(), std::size_t{0});
  double largest = 0;
  for (std::size_t row = 0; row < size; ++row) {
    for (std::size_t column = 0; column <= row; ++column) {
      at(column, row) = at(row, column);
      largest = std::max(largest, std::abs(at(row, column)));
    }
  }
  const double least = 1e-14 * largest;
  for (std::size_t step = 0; step < size;) {
    const std::size_t rows = choosePivot(step);
    const double first = at(step, step);
    const double determinant =
        rows == 1 ? first
                  : first * at(step + 1, step + 1) - at(step + 1, step) * at(step + 1, step);
    if (!(std::abs(determinant) > (rows == 1 ? least : least * largest))) {
      isSingular_ = true;
      return;
    }
    eliminate(step, rows);
    blocks_.push_back(rows);
    step += rows;
  }
}

/// Of rows and columns.
void SymmetricSolver::swap(std::size_t a, std::size_t b) {
  if (a == b) return;
  std::swap(order_[a], order_[b]);
  for (std::size_t i = 0; i < size_; ++i) std::swap(at(a, i), at(b, i));
  for (std::size_t i = 0; i < size_; ++i) std::swap(at(i, a), at(i, b));
}

/// Moves the pivot to the next rows; returns their number.
std::size_t SymmetricSolver::choosePivot(std::size_t step) {
  std::size_t diagonal = step, row = step, column = step;
  for (std::size_t i = step; i < size_; ++i) {
    if (std::abs(at(i, i)) > std::abs(at(diagonal, diagonal))) diagonal = i;
    for (std::size_t j = step; j < i; ++j) {
      if (row == column || std::abs(at(i, j)) > std::abs(at(row, column))) {
        row = i;
        column = j;
      }
    }
  }
  const double share = (1 + std::sqrt(17.0)) / 8;  // bounds the growth of the entries
  if (row == column || std::abs(at(diagonal, diagonal)) >= share * std::abs(at(row, column))) {
    swap(step, diagonal);
    return 1;
  }
  swap(step, column);
  swap(step + 1, row == step ? column : row);
  return 2;
}

void SymmetricSolver::eliminate(std::size_t step, std::size_t rows) {
  const std::size_t next = step + rows;
  const double a = at(step, step);
  const double b = rows == 2 ? at(next - 1, step) : 0, c = rows == 2 ? at(next - 1, next - 1) : 1;
  const double determinant = a * c - b * b;
  // The rows of L: those of the pivot's columns × the inverse of the block.
  std::vector<std::pair<double, double>> factors;
  for (std::size_t row = next; row < size_; ++row) {
    const double x = at(row, step), y = rows == 2 ? at(row, next - 1) : 0;
    factors.emplace_back((x * c - y * b) / determinant, (y * a - x * b) / determinant);
  }
  for (std::size_t row = next; row < size_; ++row) {
    const auto& [f, g] = factors[row - next];
    for (std::size_t column = next; column <= row; ++column) {
      double sum = f * at(column, step);
      if (rows == 2) sum += g * at(column, next - 1);
      at(row, column) -= sum;
      at(column, row) = at(row, column);
    }
  }
  for (std::size_t row = next; row < size_; ++row) {
    at(row, step) = factors[row - next].first;
    if (rows == 2) at(row, next - 1) = factors[row - next].second;
  }
}

std::vector<double> SymmetricSolver::solve(const std::vector<double>& right) const {
  std::vector<double> x(size_);
  for (std::size_t i = 0; i < size_; ++i) x[i] = right[order_[i]];
  std::size_t step = 0;
  for (const std::size_t rows : blocks_) {
    for (std::size_t row = step + rows; row < size_; ++row) {
      for (std::size_t i = step; i < step + rows; ++i) x[row] -= at(row, i) * x[i];
    }
    step += rows;
  }
  step = 0;
  for (const std::size_t rows : blocks_) {
    const double a = at(step, step);
    if (rows == 1) {
      x[step] /= a;
    } else {
      const double b = at(step + 1, step), c = at(step + 1, step + 1);
      const double determinant = a * c - b * b, first = x[step], second = x[step + 1];
      x[step] = (first * c - second * b) / determinant;
      x[step + 1] = (second * a - first * b) / determinant;
    }
    step += rows;
  }
  step = size_;
  for (auto rows = blocks_.rbegin(); rows != blocks_.rend(); ++rows) {
    step -= *rows;
    for (std::size_t i = step; i < step + *rows; ++i) {
      for (std::size_t row = step + *rows; row < size_; ++row) x[i] -= at(row, i) * x[row];
    }
  }
  std::vector<double> solution(size_);
  for (std::size_t i = 0; i < size_; ++i) solution[order_[i]] = x[i];
  return solution;
}

}  // namespace dermis
