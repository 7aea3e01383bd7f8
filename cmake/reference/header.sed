# The comment at the top of a header becomes the documentation of the file, line by line.
1,/^#pragma once/{
  s|^//|///|
  s|^#pragma once|/// @file|
}
