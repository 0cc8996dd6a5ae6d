# activecam in a container. docs/how-to/run-as-a-service.md says how to give it its devices.
FROM python:3.13-slim AS build
WORKDIR /src
COPY pyproject.toml constraints.txt README.md LICENSE ./
COPY activecam_client activecam_client
COPY calib calib
COPY daemon daemon
COPY drivers drivers
COPY hw_profiles hw_profiles
RUN python -m venv /opt/activecam \
    && /opt/activecam/bin/python -m pip install --no-cache-dir --constraint constraints.txt .

FROM python:3.13-slim
RUN useradd --uid 10001 --no-create-home --groups dialout,video activecam \
    && install --directory --owner=activecam --group=activecam --mode=0700 /var/lib/activecam
COPY --from=build /opt/activecam /opt/activecam
ENV PATH=/opt/activecam/bin:$PATH
USER activecam
WORKDIR /var/lib/activecam
VOLUME /var/lib/activecam
EXPOSE 8080
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=5s --start-period=60s --retries=3 \
    CMD ["python", "-c", "import urllib.request; urllib.request.urlopen('http://127.0.0.1:8080/api/v1/health/live', timeout=4)"]
ENTRYPOINT ["activecam"]
CMD ["serve", "--profile", "/etc/activecam/rig.toml", "--data", "/var/lib/activecam", "--host", "0.0.0.0", "--log-format", "json"]
