# mcsettle from its wheel:   docker build -t mcsettle .
#                            docker run --rm -v "$PWD:/work" mcsettle run study.toml --out results
FROM python:3.11-slim AS build
WORKDIR /src
COPY . .
RUN python -m pip install --no-cache-dir build && python -m build --wheel --outdir /dist .

FROM python:3.11-slim
COPY --from=build /dist/*.whl /tmp/
COPY constraints.txt /tmp/constraints.txt
RUN python -m pip install --no-cache-dir -c /tmp/constraints.txt /tmp/*.whl && rm -r /tmp/*.whl
RUN useradd --create-home user
USER user
WORKDIR /work
ENV OPENBLAS_NUM_THREADS=1
ENTRYPOINT ["mcsettle"]
CMD ["--help"]
