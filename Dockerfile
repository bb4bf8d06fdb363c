# kpred on the CPU; docs/install.md says how it is built and run.
ARG PYTHON=3.11

FROM python:${PYTHON}-slim AS wheel
WORKDIR /source
COPY constraints.txt pyproject.toml README.md LICENSE NOTICE ./
COPY src ./src
RUN python -m pip wheel --no-cache-dir --no-deps --wheel-dir /wheels .

FROM python:${PYTHON}-slim
# torch for the CPU alone: a tenth of the size of the one with CUDA.
ARG TORCH_INDEX=https://download.pytorch.org/whl/cpu
ARG TORCH=2.13.0
ARG EXTRAS=studio,pictures
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PYTHONDONTWRITEBYTECODE=1 \
    NUMBA_CACHE_DIR=/opt/kpred/numba HOME=/home/kpred
COPY constraints.txt /tmp/constraints.txt
RUN python -m venv /opt/kpred/venv \
    && /opt/kpred/venv/bin/pip install --index-url "${TORCH_INDEX}" "torch==${TORCH}" \
    && rm -rf /root/.cache
COPY --from=wheel /wheels /tmp/wheels
RUN sed '/^torch==/d' /tmp/constraints.txt > /tmp/without_torch.txt \
    && /opt/kpred/venv/bin/pip install -c /tmp/without_torch.txt "$(ls /tmp/wheels/kpred-*.whl)[${EXTRAS}]" \
    && rm -rf /tmp/wheels /tmp/constraints.txt /tmp/without_torch.txt
RUN groupadd --gid 1000 kpred && useradd --uid 1000 --gid kpred --create-home kpred \
    && mkdir -p /data /opt/kpred/numba && chown -R kpred:kpred /data /opt/kpred/numba
USER kpred
ENV PATH=/opt/kpred/venv/bin:$PATH
# Compiled once here, so that no container compiles at its first fit; any user may add to it (docker run --user).
RUN kpred compile && chmod -R a+rwX /opt/kpred/numba
WORKDIR /data
ENTRYPOINT ["kpred"]
CMD ["--help"]
