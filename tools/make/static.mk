# Static checks and the sanitizer build of the unit tests.
.PHONY: static
static: ## [tests] compiler warnings in every mode, cppcheck, MISRA, clang-tidy, format [docs/deviations.md]
	@test/static/need.sh cppcheck=cppcheck clang-14=clang-14 clang-tidy-14=clang-tidy-14 clang-format-14=clang-format-14
	@python3 test/static/format.py
	@$(still) 'static checks' python3 test/static/static.py

.PHONY: format
format: ## [upkeep] write the C files in the style of .clang-format
	@test/static/need.sh clang-format-14=clang-format-14
	@python3 test/static/format.py --write

# Compiled at -O0, in a third of the time; but one test turns motors for minutes.
ifeq ($(VARIANT),ubsan)
long_run := -O1
endif

.PHONY: ubsan
ubsan: setup-test ## [tests] the unit tests under clang's undefined, integer and implicit-conversion sanitizers
	+@$(in_turn) $(still) ubsan test/static/ubsan.sh
