# A server that runs with and without a GPU. Build: docker build --tag firn .

FROM node:24-bookworm-slim AS viewer
WORKDIR /src/viewer
COPY clients/typescript ../clients/typescript
COPY viewer .
RUN npm ci && npm run build

FROM rust:1.95-bookworm AS build
WORKDIR /src
COPY . .
COPY --from=viewer /src/viewer/dist viewer/dist
RUN --mount=type=cache,target=/usr/local/cargo/registry \
    --mount=type=cache,target=/src/target \
    cargo build --profile dist --locked \
    && cp target/dist/firn /usr/local/bin/firn

FROM debian:bookworm-slim
# mesa-vulkan-drivers: AMD, Intel and lavapipe, which computes on any CPU.
# libglvnd0, libxext6: what NVIDIA's driver, which its container toolkit brings along, links to. curl: for the health check.
# No versions: drivers are taken as the distribution corrects them.
# hadolint ignore=DL3008
RUN apt-get update \
    && apt-get install --yes --no-install-recommends \
        curl libglvnd0 libvulkan1 libxext6 mesa-vulkan-drivers \
    && rm -rf /var/lib/apt/lists/* \
    && useradd --uid 10001 --no-create-home --home-dir /nonexistent --shell /usr/sbin/nologin firn \
    && install --directory --owner firn /var/lib/firn
COPY --from=build /usr/local/bin/firn /usr/local/bin/firn

# The toolkit's default leaves Vulkan ("graphics") out.
ENV NVIDIA_DRIVER_CAPABILITIES=compute,graphics,utility
# A container has to listen on every address; only what its owner publishes can be reached, hence "allow open".
ENV FIRN_LISTEN=0.0.0.0:8080 FIRN_ALLOW_OPEN=true
# Sessions are kept here; without a volume they go with the container.
ENV FIRN_DATA_DIR=/var/lib/firn
VOLUME /var/lib/firn
# Mesa's device chooser looks for a display and complains that there is none; Firn chooses by itself.
ENV NODEVICE_SELECT=1
USER 10001
EXPOSE 8080
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=3s --start-period=30s --retries=3 \
    CMD ["curl", "--fail", "--silent", "--show-error", "http://127.0.0.1:8080/readyz"]
ENTRYPOINT ["firn"]
CMD ["serve"]
