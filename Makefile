# demo, test and bench each bring the environment they need; the second time that takes a moment.

PY := .venv/bin/python

# Small matrices gain nothing from BLAS threads, and test workers would fight over the cores.
export OMP_NUM_THREADS ?= 1
export OPENBLAS_NUM_THREADS ?= 1

.PHONY: demo test bench soak fuzz lint env env-test env-bench lock clean

demo: env
	$(PY) -m wbplan run clamp --out out/clamp

test: env-test
	sh tools/browser.sh
	$(PY) -m pytest -n 2 --dist loadscope $(ARGS)

bench: env-bench
	$(PY) -m wbplan.bench $(ARGS)

soak: env-test
	$(PY) tests/soak $(ARGS)

fuzz: env-test
	$(PY) tests/fuzz $(ARGS)

lint: env-test
	$(PY) -m ruff check .
	$(PY) -m ruff format --check .
	$(PY) -m mypy

env:
	@sh tools/environment.sh

env-test:
	@sh tools/environment.sh test

env-bench:
	@sh tools/environment.sh bench

# Writes constraints.txt anew with the newest versions that fit; run the tests, then commit it.
lock:
	uv pip compile pyproject.toml --universal --all-extras --upgrade --no-header --no-annotate \
		--python-version 3.11 --quiet --output-file constraints.new
	{ sed -n '/^#/p' constraints.txt; \
	  sed -e "s/ ; sys_platform == 'darwin' or sys_platform == 'linux'$$//" constraints.new; } > constraints.tmp
	rm constraints.new
	mv constraints.tmp constraints.txt

clean:
	rm -rf .venv out dist build .pytest_cache .mypy_cache .ruff_cache .hypothesis
	find . -name __pycache__ -type d -prune -exec rm -rf {} +
