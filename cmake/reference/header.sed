# The comment at the top of a header becomes the documentation of the file, line by line.
1,/^#pragma once\|^#ifndef DERMIS_DERMIS/{
  s|^//|///|
  s|^#pragma once|/// @file|
  s|^#ifndef DERMIS_DERMIS.*|/// @file\n&|
}
# The headers of C have plain comments.
/^#define DERMIS_DERMIS/,${
  s|^#define DERMIS_DERMIS.*|& ///< include guard|
  s|^// ----|//----|
  s|^// |/// |
  s|\([;,0-9f]\)\( *\)// |\1\2///< |
}
