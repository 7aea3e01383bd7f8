// Owns the precompiled headers of all tests.
namespace dermis::test {}
