# Static checks and the sanitizer build of the unit tests.
.PHONY: static
static: ## gcc and clang warnings in every mode, cppcheck, MISRA, clang-tidy; exceptions in docs/deviations.md
	@test/static/need.sh cppcheck=cppcheck clang-14=clang-14 clang-tidy-14=clang-tidy-14
	@python3 test/static/static.py

.PHONY: ubsan
ubsan: setup-test ## the unit tests built with clang's undefined, integer and implicit-conversion sanitizers
	@test/static/ubsan.sh
